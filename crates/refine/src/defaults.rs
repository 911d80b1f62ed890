//! Settings whose defaults stand beside their fields.

/// Struct of settings: each field with its unit, its reason and its default value. In files, fields that are not given have their defaults, and unknown
/// names are errors.
macro_rules! settings {
    ($(#[$of_struct:meta])* $vis:vis struct $name:ident {
        $($(#[$of_field:meta])* $of:vis $field:ident: $kind:ty = $default:expr,)*
    }) => {
        $(#[$of_struct])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
        #[serde(default, deny_unknown_fields)]
        $vis struct $name {
            $($(#[$of_field])* $of $field: $kind,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }
    };
}

pub(crate) use settings;
