"""Libraries that are needed at once are made by several processes, from bitcode that is there."""

import os
import shutil
import subprocess
import sys

import pytest

from rrtik_ompl.files.cache import cache_folder
from rrtik_ompl.kernels.simd.library import library

pytestmark = [pytest.mark.kernels, pytest.mark.timeout(3600)]

PROGRAM = """
from rrtik_ompl.kernels import warming
from rrtik_ompl.kernels.simd import library as libraries
names, made, real = ["ik.ik_kernels", "timing.kernels"], [], libraries._made
def counted(name):
    made.append(name)
    return real(name)
libraries._made = counted
warming.cores = lambda: 2
{before}
warming.load_together(names)
print(len(made), *[libraries.library(name) is not None for name in names])
"""


def made_here(folder, before=""):
    """How many of two libraries a new process makes itself, and whether both are there."""
    environment = {**os.environ, "RRTIK_CACHE": str(folder)}
    command = [sys.executable, "-c", PROGRAM.replace("{before}", before)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.split()


@pytest.fixture
def bitcode(tmp_path):
    """A cache that has the bitcode of all libraries that were compiled here, and no machine code."""
    assert library("ik.ik_kernels") is not None
    assert library("timing.kernels") is not None
    (tmp_path / "kernels").mkdir()
    for file in cache_folder("kernels").glob("*.bitcode"):
        shutil.copy(file, tmp_path / "kernels")
    return tmp_path


def test_of_two_libraries_another_process_makes_one(bitcode):
    assert made_here(bitcode) == ["1", "True", "True"]
    assert made_here(bitcode) == ["0", "True", "True"]


def test_where_no_process_can_be_begun_all_are_made_here(bitcode):
    assert made_here(bitcode, before="warming.sys.executable = '/nowhere/python'") == ["2", "True", "True"]


def test_what_a_process_does_not_live_to_make_is_made_here(bitcode):
    assert made_here(bitcode, before="warming.MAKE = 'input()'") == ["2", "True", "True"]
