"""Journals of interrupted runs."""

import prehend
import pytest
from prehend.journal import Journal

FACTS = {"method": "fused", "seed": 0}


def test_a_journal_is_gone_on_with(tmp_path):
    path = tmp_path / "run.journal"
    with Journal(path, FACTS) as journal:
        assert journal.entries == {}
        journal.append([{"index": 2, "pose": [0.1]}, {"index": 0, "error": "no mask"}])
        with pytest.raises(prehend.Error, match="another process is at work"):
            Journal(path, FACTS)
    whole = path.read_bytes()
    # Written in part.
    path.write_bytes(whole + b'{"index": 1')
    with Journal(path, FACTS) as journal:
        assert journal.entries == {2: {"index": 2, "pose": [0.1]}, 0: {"index": 0, "error": "no mask"}}
        assert path.read_bytes() == whole
        journal.append([{"index": 0, "pose": [1 / 3]}])
    with Journal(path, FACTS) as journal:
        assert journal.entries[0] == {"index": 0, "pose": [1 / 3]}
        journal.discard()
    assert not path.exists()


def test_a_journal_of_another_run_is_refused(tmp_path):
    path = tmp_path / "run.journal"
    with Journal(path, FACTS) as journal:
        journal.append([{"index": 0}])
    with pytest.raises(prehend.Error, match=r"(?s)another run.*seed: 0 \| 1\n\(restart"):
        Journal(path, FACTS | {"seed": 1})
    with Journal(path, FACTS | {"seed": 1}, restart=True) as journal:
        assert journal.entries == {}
    # Nothing whole was written: as good as none.
    path.write_text('{"meth')
    with Journal(path, FACTS) as journal:
        assert journal.entries == {}
    for text in ["poses\n", "[]\n", '{"method": "fused", "seed": 0}\n{"pose": 1}\n']:
        path.write_text(text)
        with pytest.raises(prehend.Error, match=r"line \d is of no journal"):
            Journal(path, FACTS)
        assert path.read_text() == text
