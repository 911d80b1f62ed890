//! Faults of the program, held to the frame in which they show.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::RefineError;

/// Result of `work`, or its panic as an error, so that one frame fails and the others go on.
///
/// State that `work` shares must stay valid if it panics midway. Caches do: only whole entries are added to them.
///
/// # Errors
/// Those of `work`, and [`RefineError::Panicked`].
pub fn guard<T, E: From<RefineError>>(work: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
        let text = text.unwrap_or_else(|| "a panic without a message".to_owned());
        Err(RefineError::Panicked(text).into())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_with_its_message() {
        let number = |work: fn() -> u8| guard(|| Ok::<_, RefineError>(work()));
        assert!(matches!(number(|| 7), Ok(7)));
        let said = |work: fn() -> u8| number(work).unwrap_err().to_string();
        assert_eq!(said(|| panic!("in the {}", "dark")), "the program is at fault: in the dark");
        assert_eq!(said(|| panic!("plainly")), "the program is at fault: plainly");
        assert!(matches!(guard(|| Err::<(), _>(RefineError::NoDepth)), Err(RefineError::NoDepth)));
    }
}
