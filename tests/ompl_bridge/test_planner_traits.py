"""What the library knows of planners: traits that their classes state, and no name of any."""

import ast
from pathlib import Path
from typing import ClassVar, get_args

import numpy as np
import pytest

import rrtik
import rrtik_ompl
import rrtik_planners
from rrtik_ompl.base import choices
from rrtik_ompl.base.errors import PlannerError
from rrtik_ompl.description import catalog
from rrtik_ompl.ik.genetic.options import PRESETS
from rrtik_ompl.ik.trajectory import list_ik_trajectory_methods
from rrtik_ompl.model.world_settings import ACCURACIES
from rrtik_ompl.ompl_bridge import SafePlanner, SearchResult
from rrtik_ompl.ompl_bridge.planner_names import find_planner
from rrtik_ompl.ompl_bridge.planner_options import planner_options
from rrtik_ompl.ompl_bridge.planner_traits import (
    OMPL_TRAITS,
    PlannerTraits,
    ompl_planners,
    planners_with,
    traits_of,
    unbound_planners,
)
from rrtik_ompl.planning.shortening import METHODS
from rrtik_ompl.replanning.settings import PLANNERS

LIBRARY = Path(rrtik_ompl.__file__).parent
# Replanners, methods of shortening and of improving have names of their own, some of them those of planners; a page has
# the kernels of two planners, and says in its paths which of them ran.
BY_NAME: tuple[str, ...] = (
    "ompl_bridge/planner_traits.py",
    "compat/mplib/planner.py",  # a default argument of MPlib
    "replanning/",
    "planning/shortening/",
    "cli/replan.py",
    "cli/plan.py",
    "base/choices.py",
    "problem_files/run.py",
    "replanning/scenario.py",
    "planning/plan.py",
    "planning/improving.py",
    "planning/outcome.py",
    "planning/short_path.py",
    "kernels/wasm/page_kernels.py",
    "viewer/search_story.py",  # the name of what is drawn
    "viewer/page_planner.py",
)


class Foreign(SafePlanner):
    """A planner of somebody else that goes on improving."""

    anytime: ClassVar[bool] = True
    one_goal: ClassVar[bool] = True
    path_statistics: ClassVar[tuple[str, ...]] = ("cost",)

    def __init__(self, si, *, world=None, seed=None, patience=3):
        super().__init__(si, "Foreign", world=world, seed=seed)
        self.patience = patience

    def search(self, starts, goals, checker, ptc):
        assert len(goals) == 1
        attempts = getattr(Foreign, "attempts", 0)
        Foreign.attempts = attempts + 1
        path = np.array([starts[0], goals[0]]) if attempts else None
        return SearchResult(path, {"cost": 7, "work": 7})


def test_the_classes_of_the_planners_state_their_traits():
    assert traits_of(rrtik_planners.FewestMoves).anytime
    assert traits_of(rrtik_planners.IKURT).finds_goals
    assert set(traits_of(rrtik_planners.FewestMoves).path_statistics) == {"lower_bound", "gap"}
    anytime = {name for name, planner in ompl_planners().items() if traits_of(planner).anytime}
    assert anytime == {"AORRTC", "BITstar", "InformedRRTstar", "PRMstar", "RRTstar", "SORRTstar"}


def test_the_planners_that_prove_problems_and_plan_the_routes_of_a_pilot_are_found_by_their_traits():
    proofs = planners_with(lambda traits: traits.proof_iterations)
    assert {name: traits.proof_iterations for name, traits in proofs.items()} == {
        "fastrrtconnect": 20_000,
        "bicrdt": 200,
    }
    brief = planners_with(lambda traits: traits.one_joint and traits.brief_options)
    assert {name: dict(traits.brief_options) for name, traits in brief.items()} == {
        "fewest-moves": {"searches": 1, "rounds": 0}
    }
    for name, traits in (proofs | brief).items():
        assert {*traits.brief_options, *(["max_iterations"] if traits.proof_iterations else [])} <= set(
            planner_options(find_planner(name))
        )


def test_the_planners_that_the_wheel_lacks_are_none_that_it_has():
    assert not set(unbound_planners()) & set(ompl_planners())
    assert "BiTRRT" in unbound_planners()


@pytest.mark.parametrize("name", catalog.list_planners())
def test_a_planner_with_an_iteration_limit_has_the_option(name):
    factory = find_planner(name)
    assert traits_of(factory).supports_iteration_limit == ("max_iterations" in planner_options(factory))


def test_a_planner_of_somebody_else_is_the_equal_of_ours():
    assert traits_of(Foreign) == PlannerTraits(
        anytime=True, one_goal=True, supports_iteration_limit=False, path_statistics=("cost",)
    )
    assert Foreign.default_options() == {"patience": 3}
    problem = rrtik_ompl.Problem(rrtik_ompl.World(rrtik_ompl.load_robot("planar3")), [0, 0, 0], [0.5, 0, 0])
    Foreign.attempts = 0
    found = rrtik_ompl.plan(problem, Foreign, seed=1, parameters={"patience": 1})
    assert found.found
    assert (found.statistics["attempts"], found.statistics["cost"], found.statistics["work"]) == (2, 7, 14)


def test_a_factory_that_states_nothing_has_the_default_traits():
    assert traits_of(lambda si: None) == PlannerTraits()
    assert set(OMPL_TRAITS) == set(ompl_planners().values())


def test_options_that_a_problem_does_not_allow_are_refused_without_a_word_of_breaking():
    problem = rrtik_ompl.load_problem("planar3_b")
    with pytest.raises(PlannerError, match=r"^planner BiCRDT: frozen_joints: joint "):
        rrtik_ompl.plan(problem, "bicrdt", seed=1, parameters={"frozen_joints": [0]})


@pytest.mark.parametrize("file", sorted(LIBRARY.rglob("*.py")), ids=lambda file: str(file.relative_to(LIBRARY)))
def test_the_library_knows_no_planner_by_name(file):
    tree = ast.parse(file.read_text())
    names = {*catalog.list_planners(), *ompl_planners(), *rrtik_planners.__all__}
    found = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and node.value in names}
    place = file.relative_to(LIBRARY).as_posix()
    assert not found or place.startswith(BY_NAME), f"{place} names {found}"
    compared = [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Compare)]
    assert not [text for text in compared if ".__name__" in text]


def test_the_names_to_choose_from_stand_once():
    assert set(get_args(choices.ShorteningMethod)) == set(METHODS)
    assert set(get_args(choices.IkMethod)) == {"auto", *rrtik_ompl.ik.list_methods()}
    assert set(get_args(choices.TrajectoryIkMethod)) == {"auto", *list_ik_trajectory_methods()}
    assert set(get_args(choices.GeneticPreset)) == set(PRESETS)
    assert get_args(choices.Accuracy) == ACCURACIES
    assert get_args(choices.Replanner) == PLANNERS


def test_the_short_name_is_the_same_package():
    assert rrtik.load_robot is rrtik_ompl.load_robot
    assert rrtik.__version__ == rrtik_ompl.__version__
    assert dir(rrtik) == dir(rrtik_ompl)
