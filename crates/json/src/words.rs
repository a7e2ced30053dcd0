//! Enums whose variants are words in JSON, in the tables and on the command line.

/// A text is not one of the words that were expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("not a {0}")]
pub struct BadWord(pub &'static str);

/// Defines an enum with a word for each variant. The name of the set is used in [`BadWord`].
#[macro_export]
macro_rules! words {
    (
        $(#[$about:meta])* $vis:vis enum $type:ident: $name:literal {
            $($(#[$doc:meta])* $variant:ident = $word:literal,)+
        }
    ) => {
        $(#[$about])*
        #[derive(
            Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize
        )]
        $vis enum $type {
            $($(#[$doc])* #[serde(rename = $word)] $variant,)+
        }

        impl $type {
            /// All variants, in the order of their definition.
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$variant),+];

            /// The word, in JSON and in the tables.
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)+
                }
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.as_str())
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::BadWord;

            fn from_str(text: &str) -> Result<Self, $crate::BadWord> {
                let word = Self::ALL.into_iter().find(|word| word.as_str() == text);
                word.ok_or($crate::BadWord($name))
            }
        }
    };
}
