"""A share of the inputs that are all bad: one line each, exit code 2, at once."""

import pytest

from bench.robustness import bad_inputs

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]


def test_a_share_of_them_is_refused_in_one_line():
    assert bad_inputs.bad(0, 25) == []


def test_there_are_many_and_each_stands_there_once():
    shown = [(tuple(given.files.items()), given.words) for given in bad_inputs.bad_inputs()]
    assert len(shown) >= 2000
    assert len(set(shown)) > 0.98 * len(shown)


def test_what_is_good_is_not_taken_for_refused(monkeypatch):
    good = bad_inputs.BadInput({}, ("check", "planar3_a"))
    monkeypatch.setattr(bad_inputs, "bad_inputs", lambda: (good,))
    assert "exit code 0" in bad_inputs.bad(0, 1)[0]


def test_what_takes_long_is_seen(monkeypatch):
    monkeypatch.setattr(bad_inputs, "SECONDS", 1e-6)
    assert "s of the processor" in bad_inputs.bad(0, 1)[0]
