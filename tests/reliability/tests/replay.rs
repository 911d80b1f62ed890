//! All files of the corpora, those that once were handled wrongly among them.

use prehend_reliability::corpus;
use prehend_reliability::parsers::PARSERS;
use prehend_reliability::small_dataset::SmallDataset;

#[test]
fn every_file_of_the_corpora_is_read_or_refused() {
    let dataset = SmallDataset::new().unwrap();
    for parser in PARSERS {
        let files = corpus::files(parser.name).unwrap();
        let mut read = 0;
        for (path, bytes) in &files {
            let outcome = (parser.read)(&dataset, bytes);
            let is_broken = path.extension().is_some_and(|extension| extension == "broken");
            if let Err(error) = &outcome {
                assert!(is_broken, "{}: {error:#}", path.display());
            }
            read += usize::from(outcome.is_ok());
        }
        assert!(read > 0, "nothing right of {}", parser.name);
    }
}
