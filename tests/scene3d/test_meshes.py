"""Mesh files of tissues, how elements are laid out, and keys of tissues that are refused."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.config import load_rig, parse_rig
from tautwave.errors import ConfigError
from tautwave_scenes.config.mesh_files import read_mesh
from tautwave_scenes.models.tissue.gmsh import gmsh_mesh
from tautwave_scenes.models.tissue.mesh import block, shape_of
from tautwave_scenes.networks.network import GROUND
from tautwave_scenes.networks3d.elements import lay_elements
from tautwave_scenes.rig.network3d import pruned_network3d
from tautwave_scenes.session.plan import tissue_facts
from tests.scene3d.tissues import SOFT, tissue

CONFIGS = Path(__file__).parents[2] / "configs"
BLOCK = "block: {size: [0.1, 0.02, 0.02], cells: [4, 1, 1]}"


def gmsh(mesh, head="2.2 0 8", kind=4):
    """Return a mesh as Gmsh writes it: a surface triangle first, numbers with a gap, one unused."""
    nodes = [f"{7 * at + 3} {x!r} {y!r} {z!r}" for at, (x, y, z) in enumerate(mesh.nodes)]
    nodes.append("1000 9 9 9")
    lines = ["1 2 2 0 1 3 10 17"]
    for at, corners in enumerate(mesh.tetrahedra):
        numbers = [7 * node + 3 for node in corners]
        if at % 2:
            numbers[0], numbers[1] = numbers[1], numbers[0]  # inverted: to be righted
        lines.append(f"{at + 2} {kind} 2 0 1 {' '.join(map(str, numbers))}")
    parts = [("MeshFormat", [head]), ("Nodes", [str(len(nodes)), *nodes]),
             ("Elements", [str(len(lines)), *lines])]  # fmt: skip
    return "\n".join(line for name, body in parts for line in (f"${name}", *body, f"$End{name}"))


def volumes(mesh):
    return [shape_of([mesh.nodes[node] for node in one], "")[1] for one in mesh.tetrahedra]


def test_a_gmsh_file_is_the_same_body(tmp_path):
    mesh = block((0.1, 0.02, 0.02), (4, 1, 1))
    found = gmsh_mesh(gmsh(mesh), "it.msh")
    assert found.nodes == mesh.nodes
    assert volumes(found) == pytest.approx(volumes(mesh), rel=1e-13)
    (tmp_path / "beam.msh").write_text(gmsh(block((100.0, 20.0, 20.0), (4, 1, 1))))
    text = (CONFIGS / "scene-tissue.yaml").read_text()
    rig = parse_rig(text.replace(BLOCK, "mesh: beam.msh\n      scale: 0.001"), tmp_path / "r.yaml")
    one, two = (
        pruned_network3d(it).network for it in (rig, load_rig(CONFIGS / "scene-tissue.yaml"))
    )
    assert [m.mass for m in one.masses] == pytest.approx([m.mass for m in two.masses], rel=1e-12)
    assert one.links == two.links


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.replace("2.2 0 8", "4.1 0 8"), "format 4.1 0; save it from Gmsh as version 2"),
        (lambda t: t.replace("2.2 0 8", "2.2 1 8"), "format 2.2 1"),
        (lambda t: "solid cube", "format none"),
        (lambda t: t.replace(" 4 2 0 1 ", " 5 2 0 1 "), "holds hexahedra: only linear tetrahedra"),
        (lambda t: t.replace(" 4 2 0 1 ", " 11 2 0 1 "), "second-order tetrahedra"),
        (lambda t: t.replace(" 4 2 0 1 ", " 2 2 0 1 "), "holds no tetrahedra"),
        (lambda t: t.replace("3 0.0 0.0 0.0", "3 nan 0.0 0.0"), "node 3 is not finite"),
        (lambda t: t.replace("3 0.0 0.0 0.0", "3 zero 0.0 0.0"), "is damaged"),
        (lambda t: t[: t.index("$Elements") + 40], "cut off|damaged|no tetrahedra"),
    ],
)  # fmt: skip
def test_other_meshes_are_refused_by_name(change, said):
    with pytest.raises(ValueError, match=said):
        gmsh_mesh(change(gmsh(block((1.0, 1.0, 1.0), (1, 1, 1)))), "it.msh")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ((BLOCK, "mesh: none.msh"), "none.msh cannot be read: No such file"),
        ((BLOCK, "scale: 1"), "give either block or mesh"),
        (("size: [0.1, 0.02, 0.02]", "size: [1.0, 0.02, 1.0e-9]"), "tetrahedron 1: it is flat"),
        (("size: [0.1, 0.02, 0.02]", "size: [0.1, -0.02, 0.02]"), "greater than 0"),
        (('clamped: ["-x"]', 'clamped: ["-x", "+x", "-z", "+z"]'), "every node is fixed"),
        (("  gravity: 9.81", "  scheme: symplectic"), "symplectic does not run tissues"),
        (("cells: [4, 1, 1]", "cells: [1000, 1000, 1000]"), "5000000000 tetrahedra; 100000 are"),
        (("size: [0.1, 0.02, 0.02]", "size: [1.0e+14, 0.02, 0.02]"), "check the mesh's scale"),
        (("poisson: 0.4", "poisson: 0.5"), "less than or equal to 0.49"),
        (("between: [probe, beam13]", "between: [beam, beam], chain: true"), "only masses can be"),
        (("between: [probe, beam13]", "between: [probe, beam21]"), "unknown node 'beam21'"),
    ],
)  # fmt: skip
def test_wrong_keys_of_a_tissue_are_refused(change, said):
    text = (CONFIGS / "scene-tissue.yaml").read_text()
    assert change[0] in text
    with pytest.raises(ConfigError, match=said):
        parse_rig(text.replace(*change), CONFIGS / "it.yaml")


def test_flat_inverted_and_infinite_tetrahedra_are_refused():
    good = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for corner, said in (((0.3, 0.3, 1e-9), "it is flat"), ((0.0, 0.0, -1.0), "it is inverted"),
                         ((0.0, 0.0, float("nan")), "not all finite")):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            shape_of((*good[:3], corner), "one")


def test_tetrahedra_that_overlap_are_refused():
    mesh = block((1.0, 1.0, 1.0), (1, 1, 1))
    for number in range(5):  # one of them twice, in another order
        a, b, c, d = mesh.tetrahedra[number]
        doubled = mesh._replace(tetrahedra=(*mesh.tetrahedra, (c, a, b, d)))
        with pytest.raises(ValueError, match="same side of the face of nodes"):
            gmsh_mesh(gmsh(doubled), "it.msh")
    nodes = (*mesh.nodes, (0.4, 0.5, 0.6))  # a peak inside of another one
    a, b, c, _ = mesh.tetrahedra[4]
    with pytest.raises(ValueError, match="overlap"):
        gmsh_mesh(
            gmsh(mesh._replace(nodes=nodes, tetrahedra=(*mesh.tetrahedra, (a, b, c, 8)))), "i"
        )


def test_the_arrays_of_elements_have_the_lengths_and_blocks_that_they_say():
    """Two cells of six; of one that is clamped whole nothing is laid out."""
    slow = SOFT._replace(branches=((0.3, 0.01), (0.2, 0.1)))
    network = tissue((2, 1, 1), material=slow)
    names = [mass.name for mass in network.masses]
    at = {name: k for k, name in enumerate([*names, *(name for name, _ in network.grounds)])}
    one = network.elements[0]._replace(branches=((0.5, 0.02),))
    still = one._replace(corners=(GROUND,) * 4)
    t, tissues = lay_elements([one, still, *network.elements[1:]], at, len(names))
    n, e, blocks = len(names), len(network.elements), t.row[-1]
    assert t.size == [e, 2]
    assert tissues == ("b",) * e
    per = {
        **dict.fromkeys(("volume", "mu", "lam", "viscous", "stiff", "kept", "dissipated"), 1),
        **dict.fromkeys(("grad", "turn", "next_turn"), 9),
        **{"corner": 4, "place": 16, "strain": 6, "next_strain": 6},
        **{"share": 2, "relax": 2, "held": 12},
    }
    assert {name: len(getattr(t, name)) for name in per} == {
        name: each * e for name, each in per.items()
    }
    assert (len(t.owned), len(t.row), len(t.column)) == (n + 1, n + 1, blocks)
    assert len(t.tangent) == 9 * blocks
    corners = [t.corner[4 * k : 4 * k + 4] for k in range(e)]
    owners = [min(four) for four in corners]
    assert [t.owned[m] for m in range(n + 1)] == [sum(o < m for o in owners) for m in range(n + 1)]
    for m in range(n):
        near = t.column[t.row[m] : t.row[m + 1]]
        meets = {node for four in corners if m in four for node in four if node < n}
        assert near[0] == m
        assert sorted(near) == sorted(meets)
    for k, four in enumerate(corners):
        for i, a in enumerate(four):
            for j, b in enumerate(four):
                place = t.place[16 * k + 4 * i + j]
                if a < n and b < n:
                    assert t.row[a] <= place < t.row[a + 1]
                    assert t.column[place] == b
                else:
                    assert place == -1
    first = corners.index([at[name] for name in one.corners])
    assert t.share[2 * first : 2 * first + 2] == [0.5, 0.0]
    assert t.relax[2 * first : 2 * first + 2] == [0.02, 1.0]
    for turn in (t.turn, t.next_turn):
        assert turn == np.eye(3).ravel().tolist() * e
    for zero in (t.strain, t.held, t.next_strain, t.tangent, t.kept, t.dissipated):
        assert not any(zero)


# -- physical groups, other files, size and mass --------------------------------------------------


def grouped():
    """Return a block as Gmsh writes it, with its -x face as the group `root`, one point as 7."""
    mesh = block((0.1, 0.02, 0.02), (4, 1, 1))
    text = gmsh(mesh)
    left = [7 * at + 3 for at, (x, _, _) in enumerate(mesh.nodes) if x == 0.0]
    count = len(mesh.tetrahedra)
    more = [
        f"{count + 2} 2 2 5 1 {left[0]} {left[1]} {left[2]}",
        f"{count + 3} 2 2 5 1 {left[1]} {left[2]} {left[3]}",
        f"{count + 4} 15 2 7 1 10",
    ]
    text = text.replace(f"\n{count + 1}\n1 2 2", f"\n{count + 4}\n1 2 2")
    text = text.replace("\n$EndElements", "\n" + "\n".join(more) + "\n$EndElements")
    names = '$PhysicalNames\n1\n2 5 "root"\n$EndPhysicalNames\n$Nodes'
    return mesh, text.replace("$Nodes", names, 1)


def rig_of(keys):
    """Return the shipped tissue with other keys of its shape."""
    text = (CONFIGS / "scene-tissue.yaml").read_text()
    text = text.replace(BLOCK, keys.replace(", ", "\n      ")).replace('clamped: ["-x"]', "")
    return parse_rig(text, CONFIGS / "it.yaml")


def test_physical_groups_are_clamped_by_name(tmp_path):
    path = tmp_path / "arm.msh"
    path.write_text(grouped()[1])
    rig = rig_of(f"mesh: {path}, clamped: [root]")
    by_face = rig_of(f"mesh: {path}, clamped: ['-x']")
    assert rig.scene.rim_of("beam") == by_face.scene.rim_of("beam")
    assert len(rig.scene.rim_of("beam")) == 4
    assert rig_of(f"mesh: {path}, clamped: ['7']").scene.rim_of("beam") == {"beam2"}
    with pytest.raises(ConfigError, match=r"'stem' is neither a face nor a physical group .*root"):
        rig_of(f"mesh: {path}, clamped: [stem]")


@pytest.mark.parametrize(
    ("name", "kind", "binary"),
    [
        ("a.msh", "gmsh", True), ("b.msh", "gmsh22", True), ("c.msh", "gmsh", False),
        ("d.vtk", "vtk", True), ("e.vtu", "vtu", True),
    ],
)  # fmt: skip
def test_other_files_are_the_same_body(tmp_path, name, kind, binary):
    meshio = pytest.importorskip("meshio")
    mesh, _ = grouped()
    count = len(mesh.tetrahedra)
    tags = {"gmsh:physical": [np.full(count, 3)], "gmsh:geometrical": [np.full(count, 1)]}
    written = meshio.Mesh(
        np.array(mesh.nodes),
        [("tetra", np.array(mesh.tetrahedra))],
        cell_data=tags,
        field_data={"body": np.array([3, 3])},
    )
    meshio.write(tmp_path / name, written, file_format=kind, binary=binary)
    found = read_mesh(tmp_path / name)
    assert np.array(found.nodes) == pytest.approx(np.array(mesh.nodes), abs=1e-7)
    assert volumes(found) == pytest.approx(volumes(mesh), rel=1e-5)
    if kind != "gmsh":  # meshio writes no groups into version 4.1
        named = "body" if kind == "gmsh22" else "3"
        assert dict(found.groups) == {named: tuple(range(len(mesh.nodes)))}


VERSION_4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
2 5 "root"
3 3 "body"
$EndPhysicalNames
$Entities
0 0 1 1
1 0 0 0 1 1 1 1 5 0
1 0 0 0 1 1 1 1 3 0
$EndEntities
$Nodes
1 4 1 4
3 1 0 4
1
2
3
4
0 0 0
1 0 0
0 1 0
0 0 1
$EndNodes
$Elements
2 2 1 2
2 1 2 1
1 1 2 3
3 1 4 1
2 1 2 3 4
$EndElements
"""


def test_groups_of_version_4_come_along(tmp_path):
    """A tetrahedron as the manual of Gmsh lays out a file of version 4.1."""
    pytest.importorskip("meshio")
    (tmp_path / "a.msh").write_text(VERSION_4)
    found = read_mesh(tmp_path / "a.msh")
    assert volumes(found) == pytest.approx([1.0 / 6.0])
    assert dict(found.groups) == {"root": (0, 1, 2), "body": (0, 1, 2, 3)}


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.vtk", b"no mesh", "is damaged, or no mesh that meshio reads"),
        ("b.msh", b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n9", "is damaged, or no mesh"),
        ("c.stl", b"solid", "meshes are .msh, .vtk, .vtu files"),
    ],
)
def test_damaged_files_are_refused_by_name(tmp_path, name, content, said):
    pytest.importorskip("meshio")
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=f"^{name}.*{said}"):
        read_mesh(tmp_path / name)


def test_without_meshio_its_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "meshio", None)
    monkeypatch.setitem(sys.modules, "meshio.vtk", None)
    (tmp_path / "a.vtk").write_bytes(b"# vtk DataFile Version 5.1")
    with pytest.raises(ConfigError, match=r"needs meshio: pip install 'tautwave\[meshes\]'"):
        read_mesh(tmp_path / "a.vtk")


@pytest.mark.parametrize(
    ("scale", "said"),
    [(1.0, "0.1 x 0.02 x 0.02 m, 0.04 kg"), (100.0, "4e+04 kg; doubtful"), (1e-3, "doubtful")],
)
def test_size_and_mass_are_said_and_doubted(tmp_path, scale, said):
    (tmp_path / "arm.msh").write_text(grouped()[1])
    rig = rig_of(f"mesh: {tmp_path / 'arm.msh'}, scale: {scale}, clamped: ['-x']")
    ((name, text),) = tissue_facts(rig)
    assert name == "beam"
    assert said in text
    assert ("doubtful" in text) == (scale != 1.0)


def test_check_says_it_on_its_first_screen():
    done = CliRunner().invoke(main, ["check", str(CONFIGS / "scene-tissue.yaml")])
    assert re.search(r"tissue beam +0.1 x 0.02 x 0.02 m, 0.04 kg\n", done.output)
