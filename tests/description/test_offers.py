"""What packages offer, read from their folders, is what importlib.metadata says."""

import importlib.metadata
import sys

import pytest

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.base.installed import installed_packages, version_of
from rrtik_ompl.description import catalog, offers
from rrtik_ompl.description.offers import Offer, offers_of

GROUPS = ("planners", "problems", "robots", "suites", "tables", "workspaces")


@pytest.fixture
def fresh():
    offers._offers.cache_clear()
    installed_packages.cache_clear()
    yield
    offers._offers.cache_clear()
    installed_packages.cache_clear()


def package(folder, name, text):
    metadata = folder / f"{name}.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(f"Name: {name.partition('-')[0]}\nVersion: {name.partition('-')[2]}\n")
    (metadata / "entry_points.txt").write_text(text)


@pytest.mark.usefixtures("fresh")
def test_offers_are_those_of_importlib(tmp_path, monkeypatch):
    arms = "[console_scripts]\nx = y:z\n\n[rrtik_ompl.robots]\n# arms\nours = our.arms : two.three [extra]\n"
    package(tmp_path / "first", "Our_Arms-1.0", arms)
    package(tmp_path / "second", "our.arms-0.9", "[rrtik_ompl.robots]\nold = our.arms:old\n")
    for folder in ("second", "first", "none"):
        monkeypatch.syspath_prepend(str(tmp_path / folder))
    monkeypatch.setattr(sys, "path", [str(tmp_path / "first"), str(tmp_path / "second"), *sys.path])

    points = importlib.metadata.entry_points()
    for group in GROUPS:
        said = {each.name: (each.value, each.module) for each in points.select(group=f"rrtik_ompl.{group}")}
        assert {name: (each.value, each.module) for name, each in offers_of(group).items()} == said
    assert version_of("our-arms") == importlib.metadata.version("our-arms") == "1.0"
    assert {"ours", "panda"} <= offers_of("robots").keys()
    assert "old" not in offers_of("robots")


@pytest.mark.usefixtures("fresh")
def test_where_packages_are_found_in_another_way_importlib_is_asked(monkeypatch):
    class Finder:
        def find_distributions(self, context):
            return []

    usual = {group: offers_of(group) for group in GROUPS}
    offers._offers.cache_clear()
    monkeypatch.setattr(sys, "meta_path", [*sys.meta_path, Finder()])
    monkeypatch.setattr(offers, "_in_folders", lambda: pytest.fail("asked"))
    assert {group: offers_of(group) for group in GROUPS} == usual


def test_an_offer_that_cannot_be_loaded_is_named(monkeypatch):
    assert Offer("pi", "math:pi").load() == Offer("same", "math : pi [extra]").load()
    assert Offer("math", "math").load().__name__ == "math"
    for value in ("math:none", "no_such_module"):
        monkeypatch.setattr(catalog, "offers_of", lambda group, value=value: {"arm": Offer("arm", value)})
        catalog._load.cache_clear()
        with pytest.raises(InputError, match=r"robot 'arm'.*reinstall"):
            catalog._load("robot", "robots", "arm")
    catalog._load.cache_clear()
