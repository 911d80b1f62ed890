//! The records of a log, one after the other.

use std::io::{ErrorKind, Read};

use mcap::McapResult;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// The longest record, compressed or not \[bytes\]: a broken length must not take all memory.
const LONGEST: usize = 1 << 29;

/// As much is read at once \[bytes\], for the same reason.
const BLOCK: usize = 1 << 20;

/// Records in the order of the file.
pub(super) struct RecordReader<R> {
    source: R,
    reader: LinearReader,
}

impl<R: Read> RecordReader<R> {
    /// Those of a file. Chunks are records.
    pub(super) fn of_file(source: R) -> Self {
        Self::new(source, LinearReaderOptions::default().with_emit_chunks(true))
    }

    /// Those of a chunk, which is a record itself.
    pub(super) fn of_chunk(source: R) -> Self {
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_validate_chunk_crcs(true);
        Self::new(source, options)
    }

    fn new(source: R, options: LinearReaderOptions) -> Self {
        let options = options.with_record_length_limit(LONGEST);
        Self { source, reader: LinearReader::new_with_options(options) }
    }

    /// What `found` finds in a record, given its kind and content. None at the end.
    pub(super) fn find_map<T>(
        &mut self,
        mut found: impl FnMut(u8, &[u8]) -> McapResult<Option<T>>,
    ) -> Option<McapResult<T>> {
        loop {
            match self.reader.next_event()? {
                Ok(LinearReadEvent::ReadRequest(count)) => {
                    match self.source.read(self.reader.insert(count.min(BLOCK))) {
                        Ok(read) => self.reader.notify_read(read),
                        Err(error) if error.kind() == ErrorKind::Interrupted => {}
                        Err(error) => return Some(Err(error.into())),
                    }
                }
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    if let Some(found) = found(opcode, data).transpose() {
                        return Some(found);
                    }
                }
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
