//! Where the formats write to.

use std::io::{BufWriter, Write};

/// One type for all destinations, so that the code of the formats is compiled once. It has a buffer because the formats
/// write many small pieces.
pub type Out<'a> = BufWriter<&'a mut dyn Write>;
