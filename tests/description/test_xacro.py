"""Macros: which expressions are evaluated, what they may read, and how long they may take."""

import math

import numpy as np
import pytest

from rrtik_ompl import InputError, Problem, World, load_problem, load_robot
from rrtik_ompl.description.catalog import robot_from_entry
from rrtik_ompl.description.xacro_expression import FUNCTIONS, MATHEMATICS, Evaluator, Refused
from rrtik_ompl.description.xacro_text import expanding, robot_text

pytestmark = pytest.mark.filterwarnings("ignore::rrtik_ompl.base.errors.MeshWarning")

ARM = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
%s
<link name="base"/><link name="hand"/><joint name="turn" type="revolute"><parent link="base"/><child link="hand"/>
<limit lower="-1" upper="%s" velocity="1" effort="1"/></joint></robot>"""
NAMES = {**FUNCTIONS, **MATHEMATICS, "a": 3, "b": 0.5, "text": "one two", "items": [1, 2, 3], "table": {"k": [4, 5]}}


def value(expression):
    return Evaluator().value(expression, NAMES.__getitem__)


@pytest.mark.parametrize(
    "expression",
    [
        "a + 2 * b - 7 // 2 % 3",
        "-a ** 2",
        "2 ** -1",
        "1 << 3 | 4 & 6 ^ 1",
        "~a",
        "not a",
        "a and 0 or 'x'",
        "1 < a <= 3 != 4",
        "a is None",
        "a in items",
        "9 not in items",
        "'y' if b > 1 else 'n'",
        "text.split()[1]",
        "text.upper() + '_' * 3",
        "items[-1]",
        "items[::-1]",
        "table['k'][0]",
        "[x * y for x in items for y in items if x]",
        "{k: v for k, v in table.items()}",
        "dict(a=1, **table)",
        "any(x > 2 for x in items)",
        "max(items, key=str)",
        "list(map(str, items))",
        "list(zip(items, range(3)))",
        "sorted({3, 1})",
        "'%.3f' % pi",
        "'{:5.2f}|{n}'.format(b, n=1)",
        "','.join([str(x) for x in items])",
        "radians(90)",
        "hypot(*[3, 4])",
        "round(b, 1)",
        "isinstance(a, int)",
        "text.replace('one', 'three')",
        "type(a) == int",
        "(1, 2) + (3,)",
        "[a, *items]",
        "'robot 5000 %s' % a",
    ],
)
def test_what_is_on_the_list_has_the_value_that_python_gives_it(expression):
    assert value(expression) == eval(expression, {"__builtins__": {}, **NAMES})


def test_arithmetic_has_the_value_that_python_gives_it():
    rng = np.random.default_rng(0)

    def tree(depth):
        if depth == 0:
            return str(rng.choice(["a", "b", "2", "0.7", "pi"]))
        left, right = tree(depth - 1), tree(depth - 1)
        return rng.choice(
            [f"({left} {op} {right})" for op in "+-*"] + [f"sin({left})", f"({left} if {right} > 1 else 0)"]
        )

    for _ in range(100):
        text = str(tree(4))
        assert value(text) == eval(text, {"__builtins__": {}, **NAMES})


@pytest.mark.parametrize(
    "expression",
    [
        "lambda: 1",
        "().__class__",
        "text.encode()",
        "text.format.x",
        "'{0.x}'.format(a)",
        "'{0[0]}'.format(items)",
        "list(map('{0.__class__}'.format, items))",
        "(x := 1)",
        "f'{a}'",
        "b'a'",
        "...",
        "a @ a",
        "dict.fromkeys(items)",
        "9 ** 9 ** 9",
        "1 << 10 ** 9",
        "'a' * 10 ** 9",
        "items * 10 ** 7",
        "range(10 ** 9)",
        "'%9999d' % a",
        "'%*d' % (9, a)",
        "'{:{}}'.format(a, 9999)",
        "'{:9999}'.format(a)",
        "text.zfill(10 ** 9)",
        "dict(__a=1)",
        "[__x for __x in items]",
        "'a'.join(['b' * 1000000] * 1000)",
        "('a' * 9999).replace('a', 'b' * 9999)",
        "a.real",
        "items.__len__()",
        "print",
    ],
)
def test_what_is_not_on_the_list_is_refused(expression):
    with pytest.raises((Refused, NameError)) as error:
        value(expression)
    assert isinstance(error.value, Refused) or expression == "print"


@pytest.fixture
def write(tmp_path):
    pytest.importorskip("xacro")

    def written(before, upper="1", name="arm.xacro"):
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(ARM % (before, upper))
        return file

    return written


def test_values_reach_the_robot(write):
    file = write('<xacro:property name="p" value="${dict(a=[1, 2])}"/>', "${p['a'][1] * sin(pi / 2)}")
    assert load_robot(file).upper[0] == pytest.approx(2.0)


def test_numbers_with_units_of_yaml_are_expressions_too(write, tmp_path):
    (tmp_path / "limits.yaml").write_text("upper: !degrees 2 * 45\n")
    file = write('<xacro:property name="c" value="${xacro.load_yaml(\'limits.yaml\')}"/>', "${c.upper}")
    assert load_robot(file).upper[0] == pytest.approx(math.pi / 2)
    (tmp_path / "limits.yaml").write_text('upper: !degrees "(lambda: 45)()"\n')
    with pytest.raises(InputError, match="a lambda is not on the list"):
        robot_text(file)


def test_a_refusal_names_file_line_expression_and_remedy(write):
    file = write("\n<xacro:property\n name='p'\n value='${(lambda x: x &lt; 1)(2)}'/>", "${p}")
    said = r"arm\.xacro:5: xacro: expression '\(lambda x: x < 1\)\(2\)': a lambda is not on the list; .*trust_xacro"
    with pytest.raises(InputError, match=said):
        load_robot(file)


def test_an_error_in_an_included_file_names_that_file(write, tmp_path):
    write("\n<link name='${nope}'/>", name="part.xacro")
    with pytest.raises(InputError, match=r"part\.xacro:3.*nope"):
        load_robot(write('<xacro:include filename="part.xacro"/>'))


def test_trust_hands_an_expression_to_xacro(write, tmp_path):
    file = write("", "${(lambda: 2)()}")
    with pytest.raises(InputError, match="a lambda is not on the list"):
        load_robot(file)
    robot = load_robot(file, trust_xacro=True)
    assert robot.upper[0] == 2.0
    Problem(World(robot), [0.0], [0.5]).save(tmp_path / "p.yaml")
    assert "trust" not in (tmp_path / "p.yaml").read_text()


def test_a_problem_is_opened_with_trust_by_whoever_opens_it_alone(write, tmp_path):
    file = write("", "${(lambda: 2)()}")
    rest = "start: {joints: [0]}\ngoal: {joints: [0.5]}\n"
    (tmp_path / "p.yaml").write_text(f"version: 1\nrobot: {{urdf: {file.name}}}\n{rest}")
    (tmp_path / "q.yaml").write_text(f"version: 1\nrobot: {{urdf: {file.name}, trust_xacro: true}}\n{rest}")
    for problem in ("q.yaml", "p.yaml"):
        with pytest.raises(InputError, match="trust_xacro"):
            load_problem(tmp_path / problem)
    assert load_problem(tmp_path / "p.yaml", trust_xacro=True).robot.upper[0] == 2.0
    for entry in ({"name": "planar", "trust_xacro": True}, {"urdf": "arm.xacro", "xacro_limits": {"seconds": 99}}):
        with pytest.raises(InputError, match="whoever opens the file"):
            robot_from_entry(entry)


def test_macros_read_their_package_and_packages_that_are_given(write, tmp_path):
    write("", name="robots/arm/parts/a.xacro")
    write("", name="elsewhere/other/b.xacro")
    here = write('<xacro:include filename="../parts/a.xacro"/>', name="robots/arm/urdf/arm.xacro")
    assert "hand" in robot_text(here)
    there = write('<xacro:include filename="../../../elsewhere/other/b.xacro"/>', name="robots/arm/urdf/arm.xacro")
    assert "hand" in robot_text(there, [tmp_path / "elsewhere"])
    (tmp_path / "robots" / "arm" / "package.xml").write_text("<package/>")
    far = write(f'<xacro:include filename="{__file__}"/>', name="robots/arm/urdf/arm.xacro")
    with pytest.raises(InputError, match=r"arm\.xacro:2: xacro: '.*test_xacro\.py'.*outside the folders"):
        robot_text(far)


def test_hidden_files_and_links_to_other_places_are_not_read(write, tmp_path):
    write("", name="arm/.secret/a.xacro")
    (tmp_path / "arm" / "link.xacro").symlink_to(__file__)
    for name in (".secret/a.xacro", "link.xacro"):
        with pytest.raises(InputError, match="outside the folders"):
            robot_text(write(f'<xacro:include filename="{name}"/>', name="arm/arm.xacro"))


def test_installed_links_to_the_sources_of_a_package_are_read(write, tmp_path):
    write("", name="src/parts/a.xacro")
    (tmp_path / "src" / "parts" / "package.xml").write_text("<package/>")
    (tmp_path / "share" / "parts").mkdir(parents=True)
    (tmp_path / "share" / "parts" / "package.xml").write_text("<package/>")
    (tmp_path / "share" / "parts" / "a.xacro").symlink_to(tmp_path / "src" / "parts" / "a.xacro")
    assert "hand" in robot_text(write('<xacro:include filename="$(find parts)/a.xacro"/>', name="share/arm/arm.xacro"))


def test_the_caller_gives_limits(write):
    file = write("", "${len([x for x in range(1000000) for y in range(1000)])}")
    with pytest.raises(InputError, match=r"0\.5 s.*xacro_limits="):
        load_robot(file, xacro_limits={"seconds": 0.5})
    with pytest.raises(InputError, match=r"xacro_limits.*second.*'seconds'"):
        load_robot(file, xacro_limits={"second": 1})
    with pytest.raises(InputError, match=r"xacro_limits: seconds.*0"):
        load_robot(file, xacro_limits={"seconds": 0})


def test_a_text_is_expanded_again_when_an_included_file_has_changed(write, tmp_path):
    write("<xacro:property name='p' value='7'/>", name="part.xacro")
    file = write('<xacro:include filename="part.xacro"/>', "${p}")
    assert 'upper="7"' in robot_text(file)
    write("<xacro:property name='p' value='88'/>", name="part.xacro")
    assert 'upper="88"' in robot_text(file)


def test_trust_ends_with_its_block(write):
    file = write("", "${(lambda: 2)()}")
    with expanding(trusted=True), expanding():
        assert 'upper="2"' in robot_text(file)
    with pytest.raises(InputError, match="a lambda is not on the list"):
        robot_text(write("", "${(lambda: 3)()}"))


def test_macros_in_a_file_called_urdf_are_expanded_too(write):
    file = write('<xacro:property name="p" value="2"/>', "${p}", name="arm.urdf")
    assert load_robot(file).upper[0] == 2.0
    assert load_robot(file, xacro_args={"unused": 1}).upper[0] == 2.0


def test_an_argument_without_a_value_is_named_with_the_remedy(write):
    file = write("\n<xacro:arg name='ur_type' default='x'/>", "$(arg reach)")
    with pytest.raises(InputError, match=r'Undefined substitution argument reach; give xacro_args=\{"reach": \.\.\.\}'):
        load_robot(file)
    assert load_robot(file, xacro_args={"reach": 1.5}).upper[0] == 1.5


def test_a_package_that_is_not_found_is_said_once(write):
    with pytest.raises(InputError, match="'nowhere'") as error:
        robot_text(write('<xacro:include filename="$(find nowhere)/a.xacro"/>'))
    assert str(error.value).count("nowhere") == 1
