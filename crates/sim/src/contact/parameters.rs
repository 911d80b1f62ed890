//! Parameters of laws: their values, and the one table that checks, registry, error messages and docs read.

use smallvec::SmallVec;

use super::error::LawError;
use super::range::ParameterRange;

/// Copy of the parameters of a law; up to eight without allocation.
pub(crate) type ParamValues<T> = SmallVec<[T; 8]>;

/// One of the numbers that a law is made from.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct LawParameter {
    /// Its name, as errors call it.
    pub name: &'static str,
    /// Its unit; empty for plain numbers.
    pub unit: &'static str,
    /// Meaning, in a few words.
    pub meaning: &'static str,
    /// Range that it has to be in.
    pub range: ParameterRange,
}

impl LawParameter {
    /// Checks that `value` is in range.
    ///
    /// # Errors
    /// [`LawError::Range`] if it is not.
    pub fn check(&self, value: f64) -> Result<(), LawError> {
        self.range.check(self.name, value)
    }
}

/// A fixed number of parameters: an array, or a pair of such, one after the other.
pub trait ParameterArray<T>: Copy {
    /// The first of `values`, and those that are left; `None` if there are too few.
    fn split(values: &[T]) -> Option<(Self, &[T])>;

    /// Appends these to `values`.
    fn append_to(&self, values: &mut Vec<T>);

    /// These in a row.
    fn to_vec(&self) -> Vec<T> {
        let mut values = Vec::new();
        self.append_to(&mut values);
        values
    }
}

impl<T: Copy, const N: usize> ParameterArray<T> for [T; N] {
    #[inline(always)]
    fn split(values: &[T]) -> Option<(Self, &[T])> {
        values.split_first_chunk().map(|(first, rest)| (*first, rest))
    }

    fn append_to(&self, values: &mut Vec<T>) {
        values.extend(self);
    }
}

impl<T, A: ParameterArray<T>, B: ParameterArray<T>> ParameterArray<T> for (A, B) {
    #[inline(always)]
    fn split(values: &[T]) -> Option<(Self, &[T])> {
        let (a, rest) = A::split(values)?;
        let (b, rest) = B::split(rest)?;
        Some(((a, b), rest))
    }

    fn append_to(&self, values: &mut Vec<T>) {
        self.0.append_to(values);
        self.1.append_to(values);
    }
}

/// Interface of laws with parameters that may carry derivatives: a normal law or a friction law.
pub trait Parameters: Send + Sync {
    /// The parameters over a scalar: `[T; N]`.
    type Params<T: Copy>: ParameterArray<T>;

    /// Their values.
    fn values(&self) -> Self::Params<f64>;

    /// Names of the parameters, in their order: empty where they have none.
    fn names(&self) -> Vec<&'static str> {
        vec![""; self.values().to_vec().len()]
    }

    /// Checks that `values` and all other numbers of the law are in their ranges.
    ///
    /// # Errors
    /// Names the first that is not.
    fn check(&self, _values: &Self::Params<f64>) -> Result<(), LawError> {
        Ok(())
    }
}

/// [`Parameters`] with a table, and constants that never carry derivatives.
pub(crate) trait Tabulated: Parameters {
    /// The constants over a scalar.
    type Constants<T: Copy>: ParameterArray<T>;

    /// Meaning, in a few words.
    const SUMMARY: &'static str;

    /// The parameters, in their order.
    const PARAMETERS: Self::Params<LawParameter>;

    /// The constants, in their order.
    const CONSTANTS: Self::Constants<LawParameter>;

    /// Law of these values; they are not checked.
    fn from_values(params: Self::Params<f64>, constants: Self::Constants<f64>) -> Self;
}

/// Declares a part of a law: a struct with one field for each parameter and then each constant, its table and its check.
///
/// A summary follows the name. An entry reads `name [unit] Range "meaning";`. The function after `where` checks what concerns several parameters.
macro_rules! law_part {
    (
        $(#[$attribute:meta])*
        pub struct $name:ident: $summary:literal {
            $($param:ident [$unit:tt] $range:ident $meaning:tt;)*
        }
        $(constants { $($constant:ident [$c_unit:tt] $c_range:ident $c_meaning:tt;)* })?
        $(where $relation:ident($($own:ident),*))?
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name {
            $(#[doc = $crate::contact::parameters::field_doc!($meaning $unit $range)]
            pub $param: f64,)*
            $($(#[doc = $crate::contact::parameters::field_doc!($c_meaning $c_unit $c_range)]
            pub $constant: f64,)*)?
        }

        impl $crate::contact::parameters::Parameters for $name {
            type Params<T: Copy> = [T; { [$(stringify!($param)),*].len() }];

            fn values(&self) -> Self::Params<f64> {
                [$(self.$param),*]
            }

            fn names(&self) -> Vec<&'static str> {
                vec![$(stringify!($param)),*]
            }

            fn check(&self, values: &Self::Params<f64>) -> Result<(), $crate::contact::error::LawError> {
                use $crate::contact::parameters::Tabulated;
                let constants: <Self as Tabulated>::Constants<f64> = [$($(self.$constant),*)?];
                Self::PARAMETERS.iter().zip(values).try_for_each(|(p, x)| p.check(*x))?;
                Self::CONSTANTS.iter().zip(constants).try_for_each(|(p, x)| p.check(x))?;
                #[allow(unused_variables)]
                let [$($param),*] = *values;
                $($relation($($own),*)?;)?
                Ok(())
            }
        }

        impl $crate::contact::parameters::Tabulated for $name {
            type Constants<T: Copy> =
                [T; { const NAMES: &[&str] = &[$($(stringify!($constant)),*)?]; NAMES.len() }];

            const SUMMARY: &'static str = $summary;

            const PARAMETERS: Self::Params<$crate::contact::parameters::LawParameter> =
                [$($crate::contact::parameters::entry!($param $unit $range $meaning)),*];

            const CONSTANTS: Self::Constants<$crate::contact::parameters::LawParameter> =
                [$($($crate::contact::parameters::entry!($constant $c_unit $c_range $c_meaning)),*)?];

            fn from_values(
                [$($param),*]: Self::Params<f64>,
                [$($($constant),*)?]: Self::Constants<f64>,
            ) -> Self {
                Self { $($param,)* $($($constant),*)? }
            }
        }
    };
}

/// An entry of a table.
macro_rules! entry {
    ($name:ident $unit:tt $range:ident $meaning:tt) => {
        $crate::contact::parameters::LawParameter {
            name: stringify!($name),
            unit: $unit,
            meaning: $meaning,
            range: $crate::contact::range::ParameterRange::$range,
        }
    };
}

/// The documentation of an entry.
macro_rules! field_doc {
    ($meaning:tt "" $range:ident) => {
        concat!(
            $meaning,
            " ([`",
            stringify!($range),
            "`](crate::contact::ParameterRange::",
            stringify!($range),
            "))"
        )
    };
    ($meaning:tt $unit:tt $range:ident) => {
        concat!(
            $meaning,
            " \\[",
            $unit,
            "\\] ([`",
            stringify!($range),
            "`](crate::contact::ParameterRange::",
            stringify!($range),
            "))"
        )
    };
}

pub(crate) use {entry, field_doc, law_part};
