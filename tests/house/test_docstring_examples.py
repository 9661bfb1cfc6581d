"""Every public name of the library shows an example that runs."""

import doctest
import inspect

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.lazy import public_values

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
# Names whose use needs more than a few lines, which the pages show.
WITHOUT = {"ompl.MotionChecker", "ompl.check_planner", "sensing.detect_in_rig", "sensing.relative_pose"}
PUBLIC = {name: value for name, value in public_values(rrtik).items() if not inspect.ismodule(value)}


def examples(name):
    text = inspect.getdoc(PUBLIC[name]) or ""
    return doctest.DocTestParser().get_doctest(text, {"np": np, "rrtik": rrtik}, name, name, 0)


@pytest.mark.parametrize("name", sorted({*PUBLIC} - WITHOUT))
def test_the_example_of_a_public_name_runs(name, tmp_path, monkeypatch):
    example = examples(name)
    assert example.examples
    monkeypatch.chdir(tmp_path)
    said = []
    doctest.DocTestRunner(optionflags=FLAGS).run(example, out=said.append)
    assert not said, "".join(said)


def test_names_without_an_example_are_counted():
    assert {name for name in PUBLIC if not examples(name).examples} == WITHOUT
