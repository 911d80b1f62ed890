//! Memory of the tape: chunks that are never moved, and kept for the next recording.

/// Items of one chunk; some 200 kB of nodes, so that a small recording stays in the cache.
const CHUNK: usize = 8192;

/// A stack of items in chunks. Growing copies nothing, shrinking frees nothing.
pub(crate) struct Arena<T> {
    full: Vec<Vec<T>>,
    current: Vec<T>,
    spare: Vec<Vec<T>>,
}

/// A height of the stack.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub(crate) struct Mark {
    chunk: usize,
    len: usize,
}

impl Mark {
    /// The height `len` items above this one, in the same chunk.
    pub(crate) fn above(self, len: usize) -> Self {
        Self { chunk: self.chunk, len: self.len + len }
    }
}

impl<T> Arena<T> {
    pub(crate) const fn new() -> Self {
        Self { full: Vec::new(), current: Vec::new(), spare: Vec::new() }
    }

    /// A new chunk for at least `len` items.
    #[cold]
    fn next_chunk(&mut self, len: usize) {
        let fitting = self.spare.iter().rposition(|chunk| chunk.capacity() >= len);
        let next = match fitting {
            Some(index) => self.spare.swap_remove(index),
            None => Vec::with_capacity(len.max(CHUNK)),
        };
        self.full.push(std::mem::replace(&mut self.current, next));
    }

    /// Where `len` items may be added next to each other; [`Self::take_back`] finds them again.
    #[inline]
    pub(crate) fn room(&mut self, len: usize) -> &mut Vec<T> {
        if self.current.capacity() - self.current.len() < len {
            self.next_chunk(len);
        }
        &mut self.current
    }

    #[inline]
    pub(crate) fn mark(&self) -> Mark {
        Mark { chunk: self.full.len(), len: self.current.len() }
    }

    pub(crate) fn truncate(&mut self, mark: Mark) {
        while self.full.len() > mark.chunk {
            let previous = self.full.pop().unwrap_or_default();
            let mut emptied = std::mem::replace(&mut self.current, previous);
            emptied.clear();
            if emptied.capacity() > 0 {
                self.spare.push(emptied);
            }
        }
        self.current.truncate(mark.len);
    }

    fn chunk(&self, index: usize) -> &[T] {
        self.full.get(index).unwrap_or(&self.current)
    }

    /// Items between `bottom` and `top` in the topmost chunk that holds any, and the mark below them.
    pub(crate) fn top_chunk(&self, bottom: Mark, mut top: Mark) -> (&[T], Mark) {
        loop {
            let start = if top.chunk == bottom.chunk { bottom.len } else { 0 };
            if top.len > start || top.chunk == bottom.chunk {
                let below = Mark { chunk: top.chunk, len: start };
                return (&self.chunk(top.chunk)[start..top.len.max(start)], below);
            }
            top.chunk -= 1;
            top.len = self.chunk(top.chunk).len();
        }
    }

    /// The `len` items below `top` that were added after one call of [`Self::room`]; `top` moves below them.
    #[inline]
    pub(crate) fn take_back(&self, top: &mut Mark, len: usize) -> &[T] {
        if len == 0 {
            return &[];
        }
        while top.len == 0 {
            top.chunk -= 1;
            top.len = self.chunk(top.chunk).len();
        }
        top.len -= len;
        &self.chunk(top.chunk)[top.len..top.len + len]
    }

    /// Items between `bottom` and the top.
    pub(crate) fn len_above(&self, bottom: Mark) -> usize {
        let chunks = (bottom.chunk..=self.full.len()).map(|i| self.chunk(i).len());
        chunks.sum::<usize>() - bottom.len
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_come_back_in_order_and_are_reused() {
        let mut arena = Arena::new();
        arena.room(1).push(0);
        let bottom = arena.mark();
        for round in 0..2 {
            for i in 0..3 * CHUNK {
                arena.room(1).push(i);
            }
            arena.room(CHUNK + 1).extend(std::iter::repeat_n(7, CHUNK + 1));
            assert_eq!(arena.len_above(bottom), 4 * CHUNK + 1);
            let (mut top, mut seen) = (arena.mark(), Vec::<usize>::new());
            while top != bottom {
                let (slice, below) = arena.top_chunk(bottom, top);
                seen.extend(slice.iter().rev());
                top = below;
            }
            assert_eq!(seen.len(), 4 * CHUNK + 1);
            assert!(seen[CHUNK + 1..].iter().rev().copied().eq(0..3 * CHUNK), "{round}");
            let mut top = arena.mark();
            assert!(arena.take_back(&mut top, CHUNK + 1).iter().all(|&i| i == 7));
            let chunks = arena.full.len() + arena.spare.len();
            arena.truncate(bottom);
            assert_eq!(
                (arena.len_above(bottom), arena.full.len() + arena.spare.len()),
                (0, chunks)
            );
        }
    }
}
