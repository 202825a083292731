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

/// The members of a closed set in their order (`ALL`) and the word for each (`NAMES`, `name`), which is shown and read;
/// with `in files`, also as a word in files, and in their schema.
#[macro_export]
macro_rules! named {
    ($type:ident { $($member:ident = $word:literal),+ $(,)? }) => {
        impl $type {
            /// All of them.
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$member),+];
            /// Their names, in the same order.
            pub const NAMES: [&'static str; Self::ALL.len()] = [$($word),+];

            /// Name in files and on the command line.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$member => $word),+
                }
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::names::UnknownName;

            fn from_str(word: &str) -> std::result::Result<Self, Self::Err> {
                let found = Self::ALL.into_iter().find(|member| member.name() == word);
                found.ok_or_else(|| Self::Err { word: word.to_owned(), legal: &Self::NAMES })
            }
        }
    };
    ($type:ident { $($members:tt)+ }, in files) => {
        $crate::named!($type { $($members)+ });

        impl $crate::names::serde::Serialize for $type {
            fn serialize<S: $crate::names::serde::Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
                to.serialize_str(self.name())
            }
        }

        impl<'de> $crate::names::serde::Deserialize<'de> for $type {
            fn deserialize<D: $crate::names::serde::Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
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
