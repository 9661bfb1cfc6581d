"""Strict YAML: what it reads, what it refuses and with which line, and that writing loses nothing."""

import os

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from rrtik_ompl.base.errors import DescriptionWarning, InputError, ProblemError
from rrtik_ompl.files import strict_yaml
from rrtik_ompl.files.strict_yaml import key_path, plain_value, read_yaml, write_yaml
from rrtik_ompl.files.text import read_text, write_text


def read(tmp_path, text):
    file = tmp_path / "file.yaml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_yaml(file)


def test_values_are_read_as_in_yaml_1_2(tmp_path):
    text = "a: [1, -2.5, 1e-3, .5, true, yes, 12:30, '7', 010, ~]\nb: {c: text with blanks}\n"
    data = read(tmp_path, text).data
    assert data == {"a": [1, -2.5, 0.001, 0.5, True, "yes", "12:30", "7", 10, None], "b": {"c": "text with blanks"}}


def test_every_value_knows_its_line(tmp_path):
    document = read(tmp_path, "# comment\na: 1\nb:\n  c:\n    - x\n    - {d: 2,\n       e: 3}\n")
    lines = document.lines
    assert [lines[k] for k in (("a",), ("b",), ("b", "c"), ("b", "c", 0), ("b", "c", 1), ("b", "c", 1, "e"))] == [
        2, 3, 4, 5, 6, 7,
    ]  # fmt: skip


def test_an_error_names_file_line_and_key_even_of_a_missing_value(tmp_path):
    document = read(tmp_path, "a: 1\nb:\n  c: [1, 2]\n")
    assert str(document.error(("b", "c", 1), "too small")).endswith("file.yaml:3: b.c[1]: too small")
    assert str(document.error(("b", "d"), "missing")).endswith("file.yaml:2: b.d: missing")


def test_an_error_inside_a_with_block_gets_its_place_and_keeps_its_class(tmp_path):
    document = read(tmp_path, "a: 1\nb: 2\n")
    with pytest.raises(ProblemError, match=r"file\.yaml:2: b: it collides") as caught, document.at(("b",)):
        raise ProblemError("it collides", [("link", "wall")])
    assert caught.value.contacts == (("link", "wall"),)


def test_a_place_is_not_named_twice(tmp_path):
    document = read(tmp_path, "a:\n  b: 2\n")
    with pytest.raises(InputError) as caught, document.at(("a",)), document.at(("a", "b")):
        raise InputError("wrong")
    assert str(caught.value).count("file.yaml") == 1


BAD = {
    "a key twice": ("a: 1\nb: 2\na: 3\n", ":3: key 'a' stands here twice (first in line 1)"),
    "a key twice, nested": ("s:\n  - {k: 1, k: 2}\n", ":2: s[0]: key 'k' stands here twice"),
    "empty": ("", "the file is empty"),
    "only comments": ("# nothing\n", "the file is empty"),
    "a list": ("- 1\n- 2\n", ":1: the top level must be 'key: value' lines, found a list of 2"),
    "plain text": ("hello\n", "the top level must be 'key: value' lines, found text 'hello'"),
    "tab": ("a:\n\t- 1\n", ":2: a tab stands at the start of the line"),
    "open bracket": ("a: [1, 2\nb: 3\n", "not valid YAML"),
    "open quote": ("a: 'x\n", ":1: not valid YAML"),
    "two colons": ("a: b: c\n", ":1: not valid YAML"),
    "binary": (b"\x89PNG\r\n\xff\xfe", "not a text file"),
    "control character": ("a: \x01\n", "not valid YAML"),
    "two documents": ("a: 1\n---\nb: 2\n", ":2: a second document"),
    "python tag": ("a: !!python/object/apply:os.system [ls]\n", ":1: a: tag"),
    "own tag": ("a: !metres 3\n", "tag '!metres' cannot be used"),
    "list as key": ("[1, 2]: 3\n", "a key must be a word"),
    "unknown alias": ("a: *b\n", "alias '*b' stands for nothing"),
    "alias in itself": ("a: &x [*x]\n", "alias '*x' stands for nothing"),
    "deep": ("a: " + "[" * 50 + "]" * 50 + "\n", "nested deeper than 40 levels"),
    "very deep": ("[" * 200_000, "nested deeper than 40 levels"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_a_file_that_is_not_plain_yaml_is_refused_in_one_line(tmp_path, text, message):
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    assert message in str(caught.value)
    assert "file.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_alias_bomb_is_refused(tmp_path):
    layers = "".join(f"k{i}: &k{i} [{', '.join([f'*k{i - 1}'] * 10)}]\n" for i in range(1, 12))
    with pytest.raises(InputError, match="unfolds to more than"):
        read(tmp_path, "k0: &k0 [1, 1]\n" + layers)


def test_a_chain_of_aliases_counts_as_depth(tmp_path):
    layers = "".join(f"k{i}: &k{i} [*k{i - 1}]\n" for i in range(1, 60))
    with pytest.raises(InputError, match="nested deeper"):
        read(tmp_path, "k0: &k0 [1]\n" + layers)


def test_an_alias_stands_for_its_value(tmp_path):
    assert read(tmp_path, "a: &p {x: [1, 2]}\nb: *p\n").data["b"] == {"x": [1, 2]}


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("missing.yaml", "no such file"),
        ("no_folder/file.yaml", "folder"),
        (".", "this is a folder"),
        ("a\0b.yaml", "cannot be read"),
        ("x" * 300 + ".yaml", "cannot be read"),
    ],
)
def test_a_file_that_cannot_be_read_is_one_line(tmp_path, path, message):
    with pytest.raises(InputError, match=message):
        read_yaml(tmp_path / path)


def test_a_nearly_right_file_name_gets_a_hint(tmp_path):
    (tmp_path / "problem.yaml").write_text("a: 1\n")
    with pytest.raises(InputError, match=r"did you mean 'problem\.yaml'"):
        read_yaml(tmp_path / "problm.yaml")


def test_an_endless_file_is_refused():
    with pytest.raises(InputError, match="larger than"):
        read_text("/dev/zero")


PRINTABLE = st.characters(codec="utf-8", exclude_categories=["Cc", "Cs", "Zl", "Zp"], exclude_characters="\ufeff")
values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**18), 10**18)
    | st.floats(allow_nan=False)
    | st.text(PRINTABLE, max_size=12),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text("abc_", min_size=1), inner, max_size=4),
    max_leaves=12,
)


@given(st.dictionaries(st.text("abcxyz", min_size=1), values, min_size=1, max_size=4))
def test_what_is_written_reads_back_bit_for_bit(tmp_path_factory, data):
    file = tmp_path_factory.mktemp("yaml") / "file.yaml"
    write_yaml(file, data)
    assert repr(read_yaml(file).data) == repr(data)


def test_text_that_looks_like_a_number_or_a_word_is_quoted(tmp_path):
    data = {"a": ["1e5", "010", "yes", "null", "", "true", "-.inf", "1_000", "2024-01-01", "0x1F", "=", "<<"]}
    write_yaml(tmp_path / "f.yaml", data)
    assert read_yaml(tmp_path / "f.yaml").data == data


def test_writing_replaces_the_file_and_leaves_no_other(tmp_path):
    write_yaml(tmp_path / "f.yaml", {"a": 1})
    write_yaml(tmp_path / "f.yaml", {"a": 2})
    assert os.listdir(tmp_path) == ["f.yaml"]
    assert read_yaml(tmp_path / "f.yaml").data == {"a": 2}


def test_an_interrupted_write_keeps_the_old_file(tmp_path, monkeypatch):
    file = tmp_path / "f.yaml"
    write_yaml(file, {"a": 1})

    def interrupt(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_yaml(file, {"a": 2})
    monkeypatch.undo()
    assert read_yaml(file).data == {"a": 1}
    assert os.listdir(tmp_path) == ["f.yaml"]


def test_writing_through_a_link_keeps_the_link(tmp_path):
    (tmp_path / "real.yaml").write_text("a: 1\n")
    (tmp_path / "link.yaml").symlink_to("real.yaml")
    write_yaml(tmp_path / "link.yaml", {"a": 2})
    assert (tmp_path / "link.yaml").is_symlink()
    assert read_yaml(tmp_path / "real.yaml").data == {"a": 2}


def test_a_device_is_written_to_and_not_replaced():
    write_text("/dev/null", "text")
    assert not os.path.isfile("/dev/null")


@pytest.mark.parametrize(("path", "message"), [("no_folder/f.yaml", "does not exist; create it"), (".", "folder")])
def test_a_file_that_cannot_be_written_is_one_line(tmp_path, path, message):
    with pytest.raises(InputError, match=message):
        write_yaml(tmp_path / path, {"a": 1})


@pytest.mark.parametrize(("text", "value"), [("1", 1), ("-1.", -1.0), ("1.5e3", 1500.0), ("e3", "e3"), ("1 2", "1 2")])
def test_plain_scalars(text, value):
    assert plain_value(text) == value
    assert type(plain_value(text)) is type(value)


def test_a_key_path_reads_like_the_file():
    assert key_path(("scene", "obstacles", 3, "box")) == "scene.obstacles[3].box"


SAME = [
    "a: [1, -2.5, .inf, ~, 'x', {b: [], c: {}}]\nd: &p {x: 1e-3}\ne: *p\nf:\n  - *p\n  - |\n    text\n",
    *(text for text, _ in BAD.values() if isinstance(text, str) and "\x01" not in text),
]


@pytest.mark.parametrize("text", SAME)
def test_libyaml_and_the_parser_in_python_build_the_same(tmp_path, monkeypatch, text):
    found = []
    for name in ("CSafeLoader", "SafeLoader"):
        monkeypatch.setattr(strict_yaml, "_LOADER", getattr(yaml, name))
        try:
            document = read(tmp_path, text)
            found.append((document.data, document.lines))
        except InputError as error:
            said = str(error).partition(" (")[0]  # the parsers' own words for what is no YAML differ
            found.append(said if "nested deeper" not in said else "nested deeper")  # libyaml may not say where
    assert found[0] == found[1]


def test_in_files_of_ros_the_last_of_two_keys_counts_and_angles_have_units(tmp_path):
    file = tmp_path / "a.yaml"
    file.write_text("a: {x: 1}\nb: !degrees -180\na: {y: !radians 2}\n")
    with pytest.warns(DescriptionWarning, match=r"a\.yaml:3: key 'a' stands here twice \(first in line 1\); the last"):
        document = read_yaml(file, ros=True)
    assert document.data == {"a": {"y": 2.0}, "b": -np.pi}
    assert document.lines["a", "y"] == 3
    assert ("a", "x") not in document.lines


@pytest.mark.parametrize("text", ["a: !degrees x\n", "a: !degrees {b: 1}\n", "a: !metres 1\n", "!degrees 3: 1\n"])
def test_other_tags_are_refused_in_files_of_ros_too(tmp_path, text):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(InputError, match=r"a\.yaml:1: "):
        read_yaml(tmp_path / "a.yaml", ros=True)
