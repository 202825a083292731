//! Words for the members of closed sets, as files and command lines write them.

/// A word that names none of those there are.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("\"{word}\" is not one of {}", legal.join(", "))]
pub struct UnknownName {
    /// The word.
    pub word: String,
    /// What there is.
    pub legal: Vec<&'static str>,
}

impl UnknownName {
    /// The member of that name.
    ///
    /// # Errors
    /// When none has it.
    pub fn find<T: Copy>(word: &str, all: &[T], name: fn(T) -> &'static str) -> Result<T, Self> {
        all.iter().copied().find(|member| name(*member) == word).ok_or_else(|| Self {
            word: word.to_owned(),
            legal: all.iter().map(|member| name(*member)).collect(),
        })
    }
}

/// Display and reading of a type with `ALL` and `name`.
macro_rules! named {
    ($type:ty) => {
        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::names::UnknownName;

            fn from_str(word: &str) -> Result<Self, Self::Err> {
                Self::Err::find(word, &Self::ALL, Self::name)
            }
        }
    };
}
pub(crate) use named;
