//! A column of a table.

/// Values of a column, all rows one after the other, each row-major.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    /// Whole numbers.
    Integers(Vec<i64>),
    /// Numbers, NaN where one is not known.
    Numbers(Vec<f64>),
    /// Texts, empty where there is none.
    Texts(Vec<String>),
}

impl Values {
    /// Number of values of all rows together.
    pub(super) fn count(&self) -> usize {
        match self {
            Self::Integers(values) => values.len(),
            Self::Numbers(values) => values.len(),
            Self::Texts(values) => values.len(),
        }
    }
}

/// A named column.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TableColumn {
    /// Its name.
    pub(super) name: &'static str,
    /// Shape of what it has in a row: empty for a single value.
    pub(super) shape: Vec<usize>,
    /// Its values.
    pub(super) values: Values,
}

impl TableColumn {
    /// How many values it has in a row.
    pub(super) fn width(&self) -> usize {
        self.shape.iter().product()
    }

    /// A column of a value a row.
    pub(super) fn new<T>(
        name: &'static str,
        values: impl IntoIterator<Item = T>,
        kind: fn(Vec<T>) -> Values,
    ) -> Self {
        Self { name, shape: Vec::new(), values: kind(values.into_iter().collect()) }
    }

    /// A column of an array of that shape a row; NaN where a row has none, or less.
    pub(super) fn arrays(
        name: &'static str,
        shape: &[usize],
        rows: impl Iterator<Item = Option<Vec<f64>>>,
    ) -> Self {
        let width: usize = shape.iter().product();
        let mut values = Vec::new();
        for (k, row) in rows.enumerate() {
            values.extend(row.unwrap_or_default().into_iter().take(width));
            values.resize((k + 1) * width, f64::NAN);
        }
        Self { name, shape: shape.to_vec(), values: Values::Numbers(values) }
    }
}
