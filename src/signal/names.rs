//! Words for the members of closed sets, as files and command lines write them.

/// A word that names no member of the set.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("\"{word}\" is not one of {}", legal.join(", "))]
pub struct UnknownName {
    /// The word.
    pub word: String,
    /// The legal words.
    pub legal: &'static [&'static str],
}

#[doc(hidden)]
pub use {schemars, serde};

/// Display and reading of a type with `ALL` and a constant `name`; with `in files`, also as a word in files, and in
/// their schema.
#[macro_export]
macro_rules! named {
    ($type:ty) => {
        impl $type {
            /// The names of all of them.
            pub const NAMES: [&'static str; Self::ALL.len()] = {
                let mut names = [""; Self::ALL.len()];
                let mut i = 0;
                while i < names.len() {
                    names[i] = Self::ALL[i].name();
                    i += 1;
                }
                names
            };
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::names::UnknownName;

            fn from_str(word: &str) -> Result<Self, Self::Err> {
                let found = Self::ALL.into_iter().find(|member| member.name() == word);
                found.ok_or_else(|| Self::Err { word: word.to_owned(), legal: &Self::NAMES })
            }
        }
    };
    ($type:ty, in files) => {
        $crate::named!($type);

        impl $crate::names::serde::Serialize for $type {
            fn serialize<S: $crate::names::serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                to.serialize_str(self.name())
            }
        }

        impl<'de> $crate::names::serde::Deserialize<'de> for $type {
            fn deserialize<D: $crate::names::serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                let word = <String as $crate::names::serde::Deserialize>::deserialize(from)?;
                let unknown = |_| $crate::names::serde::de::Error::unknown_variant(&word, &Self::NAMES);
                word.parse().map_err(unknown)
            }
        }

        impl $crate::names::schemars::JsonSchema for $type {
            fn inline_schema() -> bool {
                true
            }

            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($type).into()
            }

            fn json_schema(
                _: &mut $crate::names::schemars::SchemaGenerator,
            ) -> $crate::names::schemars::Schema {
                $crate::names::schemars::json_schema!({ "type": "string", "enum": Self::NAMES })
            }
        }
    };
}
