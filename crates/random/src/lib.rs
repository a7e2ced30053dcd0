//! Seeded random numbers. Tests always run the same cases, and a study with the same seed always has the same result.
//!
//! The generator is SplitMix64. Its n-th number is a hash of its seed and n, so a [`Stream`] computes any number
//! without the numbers before it. It consists of integer operations only, so its numbers depend neither on the
//! processor nor on the version of a library. The numbers must never change, because a repeated study must have the
//! same result.
//!
//! # Sources
//! G. L. Steele, D. Lea, C. H. Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014.

/// The increment of SplitMix64: 2⁶⁴ divided by the golden ratio, rounded to an odd number.
const GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// An endless list of random numbers, each of which is computed from its index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream(u64);

impl Stream {
    /// The stream of this seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// A stream whose numbers are independent of those of this stream and of its children with other labels.
    pub fn child(self, label: u64) -> Self {
        // Without the second `mix`, the seed of the child would be a number of its parent.
        Self(mix(self.at(label)))
    }

    /// The number at an index: 64 random bits.
    pub fn at(self, index: u64) -> u64 {
        mix(self.0.wrapping_add(index.wrapping_add(1).wrapping_mul(GAMMA)))
    }

    /// The random whole number at an index, from 0 to `end` − 1. The probabilities of two numbers differ by less than
    /// `end`/2⁶⁴.
    pub fn below(self, index: u64, end: u64) -> u64 {
        ((u128::from(self.at(index)) * u128::from(end)) >> 64) as u64
    }
}

/// A bijection of 64 bits. Each bit of the result depends on all bits of the argument.
fn mix(bits: u64) -> u64 {
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// Returns the numbers of a [`Stream`] one after the other.
#[derive(Debug)]
pub struct Random {
    stream: Stream,
    next: u64,
}

impl Random {
    /// Starts at the first number of the stream of this seed.
    pub fn new(seed: u64) -> Self {
        Self { stream: Stream::new(seed), next: 0 }
    }

    /// A random number from 0 (included) to 1 (excluded).
    fn unit(&mut self) -> f64 {
        let bits = self.stream.at(self.next);
        self.next += 1;
        (bits >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A random number between two bounds, evenly distributed.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A random number between two positive bounds, evenly distributed on a logarithmic scale.
    pub fn log_between(&mut self, low: f64, high: f64) -> f64 {
        low * libm::pow(high / low, self.unit())
    }

    /// A random element of `options`.
    pub fn one_of<T: Copy>(&mut self, options: &[T]) -> T {
        options[(self.unit() * options.len() as f64) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first numbers of seed 1234567 as Java's `SplittableRandom` and the C code of S. Vigna print them
    /// (<https://prng.di.unimi.it/splitmix64.c>).
    #[test]
    fn the_stream_has_the_published_numbers() {
        let numbers = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        let stream = Stream::new(1_234_567);
        for (index, number) in numbers.into_iter().enumerate() {
            assert_eq!(stream.at(index as u64), number);
        }
    }

    #[test]
    fn the_numbers_of_child_streams_are_uncorrelated() {
        let parent = Stream::new(7);
        let (one, other) = (parent.child(1), parent.child(2));
        for pair in
            [(parent, one), (one, other), (one, one.child(1)), (one, Stream::new(8).child(1))]
        {
            let equal: u32 = (0..10_000).map(|i| (pair.0.at(i) ^ pair.1.at(i)).count_zeros()).sum();
            // 640 000 fair coins: the standard deviation is 400.
            assert!(equal.abs_diff(320_000) < 2_000, "{equal} equal bits");
        }
    }
}
