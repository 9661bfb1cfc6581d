"""Read with MuJoCo's own compiler what this reader does not: frames, replicates, attached files, fitted geoms.

The compiled model is written as plain MJCF elements, with all digits, which are then read like any other file: there is
one reader, whoever has resolved the file. Shapes that MJCF elements cannot state come beside them as meshes.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from rrtik_ompl.base.arrays import Vector
from rrtik_ompl.description.mjcf.elements import field_mesh
from rrtik_ompl.model.shapes import Mesh

JOINTS = ("free", "ball", "slide", "hinge")  # in the order of MuJoCo's numbers
GEOMS = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
EQUALITIES = ("connect", "weld", "joint", "tendon", "flex", "flexvert", "flexstrain")
UNPAINTED = (0.5, 0.5, 0.5, 1.0)  # colour of a geom that states none
PATCHES = 500  # flat faces around an ellipsoid, about: it gets some 1 % larger


def compiled(path: Path) -> tuple[Element, dict[str, Mesh]] | None:
    """Return a file as MuJoCo compiles it, and its meshes by name; None without MuJoCo, or where it refuses the file.

    Angles are in radians, and every element says where it is in its body.
    """
    try:
        import mujoco  # an extra
    except ImportError:
        return None

    told = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)  # else it writes a file MUJOCO_LOG.TXT into the current folder
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, RuntimeError):
        return None
    finally:
        mujoco.set_mju_user_warning(told)
    return _Writer(model, mujoco).written()


class _Writer:
    """The elements of a compiled model."""

    def __init__(self, model: Any, mujoco: Any) -> None:  # noqa: ANN401 - MuJoCo has no types
        self.model = model
        self.mujoco = mujoco
        self.meshes: dict[str, Mesh] = {}

    def written(self) -> tuple[Element, dict[str, Mesh]]:
        """Return the top element and the meshes."""
        model = self.model
        root = Element("mujoco", {"model": bytes(model.names).split(b"\0")[0].decode()})
        SubElement(root, "compiler", {"angle": "radian", "autolimits": "false"})
        if model.opt.disableflags & self.mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
            SubElement(SubElement(root, "option"), "flag", {"filterparent": "disable"})

        bodies = [SubElement(root, "worldbody")]
        for number in range(1, model.nbody):
            body = SubElement(bodies[model.body_parentid[number]], "body", self.named("body", number))
            place(body, model.body_pos[number], model.body_quat[number])
            if model.body_mocapid[number] >= 0:
                body.set("mocap", "true")
            bodies.append(body)

        for number in range(model.njnt):
            self.joint(number, bodies[model.jnt_bodyid[number]])
        for number in range(model.ngeom):
            self.geom(number, bodies[model.geom_bodyid[number]])
        for number in range(model.nsite):
            site = SubElement(bodies[model.site_bodyid[number]], "site", self.named("site", number))
            place(site, model.site_pos[number], model.site_quat[number])

        self.contacts(SubElement(root, "contact"))
        self.tendons(SubElement(root, "tendon"))
        self.equalities(SubElement(root, "equality"))
        self.actuators(SubElement(root, "actuator"))
        keys = SubElement(root, "keyframe")
        for number in range(model.nkey):
            if not self.name("key", number) and np.array_equal(model.key_qpos[number], model.qpos0):
                continue  # MuJoCo makes such keys up
            SubElement(keys, "key", {**self.named("key", number), "qpos": text(model.key_qpos[number])})
        return root, self.meshes

    def named(self, kind: str, number: int) -> dict[str, str]:
        """Return the name of an object as an attribute; nothing if it has none."""
        name = self.name(kind, number)
        return {"name": name} if name else {}

    def name(self, kind: str, number: int) -> str:
        """Return the name of an object."""
        return str(getattr(self.model, kind)(number).name)

    def joint(self, number: int, body: Element) -> None:
        """Add a joint to its body."""
        model = self.model
        kind = JOINTS[model.jnt_type[number]]
        if kind == "free":
            SubElement(body, "freejoint", self.named("joint", number))
            return
        joint = SubElement(body, "joint", {**self.named("joint", number), "type": kind})
        joint.set("pos", text(model.jnt_pos[number]))
        joint.set("axis", text(model.jnt_axis[number]))
        joint.set("range", text(model.jnt_range[number]))
        joint.set("limited", "true" if model.jnt_limited[number] else "false")
        joint.set("ref", text([model.qpos0[model.jnt_qposadr[number]]]))

    def geom(self, number: int, body: Element) -> None:
        """Add a geom to its body."""
        model = self.model
        kind = GEOMS[model.geom_type[number]]
        size = model.geom_size[number]
        geom = SubElement(body, "geom", self.named("geom", number))
        place(geom, model.geom_pos[number], model.geom_quat[number])
        geom.set("contype", str(model.geom_contype[number]))
        geom.set("conaffinity", str(model.geom_conaffinity[number]))
        colour = self.colour(number)
        if colour is not None:
            geom.set("rgba", text(colour))

        if kind == "ellipsoid":
            geom.set("mesh", self.kept(ellipsoid(size)))
        elif kind == "hfield":
            geom.set("mesh", self.kept(self.field(model.geom_dataid[number])))
        elif kind in ("mesh", "sdf"):
            geom.set("mesh", self.kept(self.mesh(model.geom_dataid[number])))
        else:
            geom.set("size", text(size[: {"sphere": 1, "capsule": 2, "cylinder": 2}.get(kind, 3)]))
        geom.set("type", "mesh" if geom.get("mesh") else kind)

    def colour(self, number: int) -> Vector | None:
        """Return the colour of a geom: its own, or that of its material; None if it has none of its own."""
        own: Vector = self.model.geom_rgba[number]
        if not np.allclose(own, UNPAINTED):
            return own
        material = self.model.geom_matid[number]
        painted: Vector | None = None if material < 0 else self.model.mat_rgba[material]
        return painted

    def mesh(self, number: int) -> Mesh:
        """Return a mesh as MuJoCo has centred and turned it."""
        model = self.model
        first, count = model.mesh_vertadr[number], model.mesh_vertnum[number]
        face, faces = model.mesh_faceadr[number], model.mesh_facenum[number]
        return Mesh(model.mesh_vert[first : first + count], model.mesh_face[face : face + faces])

    def field(self, number: int) -> Mesh:
        """Return a height field."""
        model = self.model
        rows = model.hfield_nrow[number]
        columns = model.hfield_ncol[number]
        first = model.hfield_adr[number]
        heights = model.hfield_data[first : first + rows * columns].reshape(rows, columns)
        return field_mesh(heights, model.hfield_size[number])

    def kept(self, mesh: Mesh) -> str:
        """Keep a mesh, and return its name."""
        name = str(len(self.meshes))
        self.meshes[name] = mesh
        return name

    def contacts(self, contact: Element) -> None:
        """Add the pairs of bodies that never collide, and the pairs of geoms that are listed."""
        for number in range(self.model.nexclude):
            signature = int(self.model.exclude_signature[number])
            names = (self.name("body", signature >> 16), self.name("body", signature & 0xFFFF))
            SubElement(contact, "exclude", dict(zip(("body1", "body2"), names, strict=True)))
        for number in range(self.model.npair):
            SubElement(contact, "pair", self.named("pair", number))

    def tendons(self, tendons: Element) -> None:
        """Add the tendons, with the joints or the sites along which they run."""
        model = self.model
        for number in range(model.ntendon):
            tendon = SubElement(tendons, "spatial", self.named("tendon", number))
            if model.tendon_limited[number]:
                tendon.set("range", text(model.tendon_range[number]))
            first = model.tendon_adr[number]
            for wrap in range(first, first + model.tendon_num[number]):
                for kind, tag in (("JOINT", "joint"), ("SITE", "site")):
                    if model.wrap_type[wrap] == getattr(self.mujoco.mjtWrap, f"mjWRAP_{kind}"):
                        SubElement(tendon, tag, {tag: self.name(tag, model.wrap_objid[wrap])})

    def equalities(self, equality: Element) -> None:
        """Add the equalities."""
        model = self.model
        for number in range(model.neq):
            kind = EQUALITIES[model.eq_type[number]]
            item = SubElement(equality, kind, self.named("equality", number))
            item.set("active", "true" if model.eq_active0[number] else "false")
            item.set("polycoef", text(model.eq_data[number][:5]))
            on_sites = model.eq_objtype[number] == self.mujoco.mjtObj.mjOBJ_SITE
            what = {"joint": "joint", "tendon": "tendon"}.get(kind, "site" if on_sites else "body")
            for key, other in (("1", model.eq_obj1id[number]), ("2", model.eq_obj2id[number])):
                if other >= 0 and (what != "body" or other > 0) and not kind.startswith("flex"):
                    item.set(f"{what}{key}", self.name(what, other))

    def actuators(self, actuators: Element) -> None:
        """Add the actuators, with their joints."""
        model = self.model
        of_joints = (self.mujoco.mjtTrn.mjTRN_JOINT, self.mujoco.mjtTrn.mjTRN_JOINTINPARENT)
        for number in range(model.nu):
            actuator = SubElement(actuators, "general", self.named("actuator", number))
            if model.actuator_trntype[number] in of_joints:
                actuator.set("joint", self.name("joint", model.actuator_trnid[number, 0]))


def place(element: Element, position: ArrayLike, turn: ArrayLike) -> None:
    """Give an element its position, and its orientation as a quaternion (w, x, y, z)."""
    element.set("pos", text(position))
    element.set("quat", text(turn))


def text(values: ArrayLike) -> str:
    """Return numbers as text, with all their digits."""
    numbers: Iterable[float] = np.asarray(values, dtype=np.float64).tolist()
    return " ".join(map(repr, numbers))


def ellipsoid(radii: Vector) -> Mesh:
    """Return a convex mesh around an ellipsoid with the given half axes [m], some 1 % larger than it."""
    number = np.arange(PATCHES // 2) + 0.5
    height = 1.0 - 4.0 * number / PATCHES
    turn = np.pi * (1.0 + 5.0**0.5) * number
    around = np.sqrt(1.0 - height**2)
    points = np.column_stack([around * np.cos(turn), around * np.sin(turn), height])

    hull = ConvexHull(points)
    outward = np.einsum("ij,ij->i", hull.equations[:, :3], np.cross(*_edges(points[hull.simplices])))
    faces = np.where(outward[:, None] > 0.0, hull.simplices, hull.simplices[:, ::-1])
    return Mesh(points / np.abs(hull.equations[:, 3]).min() * radii, faces)


def _edges(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two edges of each triangle, (m, 3, 3) -> (m, 3) each."""
    return corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
