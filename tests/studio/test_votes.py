import json

import pytest

from lipmotion.errors import InputError
from lipmotion_studio.votes import Side, Vote, read_votes, tally, votes_text

A, B, C = (Side(name, digest * 64, "e" * 64) for name, digest in (("voice", "a"), ("voice", "b"), ("other", "c")))
KEPT = Side("voice", "a" * 64, "f" * 64)
OLD = [
    {"line": "one", "shown": ["now", "the model b"], "better": "now", "edits": "e" * 64},
    {"line": "two", "shown": ["the model b", "now"], "better": "", "edits": "f" * 64},
]


def test_models_of_one_name_have_tallies_of_their_own():
    votes = [Vote("one", (A, C), 0), Vote("two", (C, A), 0), Vote("one", (B, C), 1), Vote("one", (A, C))]
    assert tally(votes, Vote("three", (A, C))) == {"better": [1, 1], "neither": 1}
    assert tally(votes, Vote("three", (C, B))) == {"better": [1, 0], "neither": 0}


def test_edits_count_where_they_differ_and_names_do_not():
    renamed = Side("renamed", A.model, "d" * 64)
    votes = [Vote("one", (A, C), 0), Vote("one", (A, KEPT), 1)]
    assert tally(votes, Vote("two", (renamed, Side("other", C.model, "d" * 64)))) == {"better": [1, 0], "neither": 0}
    assert tally(votes, Vote("two", (KEPT, A))) == {"better": [1, 0], "neither": 0}


def test_votes_are_read_as_they_were_written_and_old_ones_by_their_names(tmp_path):
    path = tmp_path / "votes.json"
    assert read_votes(path) == ()
    path.write_text(json.dumps(OLD), encoding="utf-8")
    old = read_votes(path)
    assert [[side.name for side in vote.shown] for vote in old] == [vote["shown"] for vote in OLD]
    assert [vote.better for vote in old] == [0, None]
    assert tally(old, old[0]) == {"better": [1, 0], "neither": 1}
    votes = (*old, Vote("one", (A, KEPT), 1))
    path.write_text(votes_text(votes), encoding="utf-8")
    assert read_votes(path) == votes


@pytest.mark.parametrize(
    "content", ["[1]", '["x"]', "{", '[{"line": "one", "shown": ["a", "b"], "better": "c", "edits": ""}]']
)
def test_other_files_are_refused(content, tmp_path):
    path = tmp_path / "votes.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"votes\.json"):
        read_votes(path)


def test_a_vote_is_between_two_motions_that_differ():
    for shown in ((A,), (A, A), (A, Side("renamed", A.model, A.edits))):
        with pytest.raises(InputError, match="differ"):
            Vote("one", shown)
    with pytest.raises(InputError, match="better"):
        Vote("one", (A, B), 2)
    with pytest.raises(InputError, match="digests"):
        Side("voice", "A", "")
