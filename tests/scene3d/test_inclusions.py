"""Parts of a tissue that are of another material: physical groups of tetrahedra, by name."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.errors import ConfigError
from tautwave_scenes.config.mesh_files import read_mesh
from tautwave_scenes.models.tissue.gmsh import gmsh_mesh
from tautwave_scenes.models.tissue.mesh import block, on_faces, shape_of
from tautwave_scenes.networks3d.network import Network3d
from tautwave_scenes.networks3d.tissue import tissue_of
from tautwave_scenes.rig.network3d import materials_of, pruned_network3d
from tautwave_scenes.session.plan import plan, tissue_facts
from tests.scene3d.test_meshes import rig_of
from tests.scene3d.test_tissue import stiffness_of

SIZE, CELLS = (0.1, 0.02, 0.02), (5, 1, 1)
YOUNG, STIFF = 2e4, 3e5
BODY, TUMOUR, ROOT = 11, 12, 13
NAMES = {(3, BODY): "body", (3, TUMOUR): "tumour", (2, ROOT): "root"}


def middle_of(mesh):
    """Return the numbers of the tetrahedra between 0.04 and 0.08 m."""
    centres = [np.mean([mesh.nodes[node] for node in one], axis=0)[0] for one in mesh.tetrahedra]
    return [at for at, x in enumerate(centres) if 0.04 < x < 0.08]


def gmsh_text(twice=(), names=NAMES):
    """Return a bar whose middle is the group `tumour`; tetrahedra `twice` are of `body`, too."""
    mesh = block(SIZE, CELLS)
    inside = middle_of(mesh)
    nodes = [f"{at + 1} {x!r} {y!r} {z!r}" for at, (x, y, z) in enumerate(mesh.nodes)]
    left = [at + 1 for at, place in enumerate(mesh.nodes) if place[0] == 0.0]
    lines = [f"1 2 2 {ROOT} 1 {' '.join(map(str, left[:3]))}"]
    for at, corners in enumerate(mesh.tetrahedra):
        groups = [TUMOUR if at in inside else BODY] + ([BODY] if at in twice else [])
        for group in groups:
            numbers = " ".join(str(node + 1) for node in corners)
            lines.append(f"{len(lines) + 1} 4 2 {group} 1 {numbers}")
    named = [f'{size} {tag} "{name}"' for (size, tag), name in names.items()]
    parts = [("MeshFormat", ["2.2 0 8"]), ("PhysicalNames", [str(len(named)), *named])]
    parts += [("Nodes", [str(len(nodes)), *nodes]), ("Elements", [str(len(lines)), *lines])]
    return "\n".join(line for name, body in parts for line in (f"${name}", *body, f"$End{name}"))


@pytest.fixture
def bar(tmp_path):
    path = tmp_path / "bar.msh"
    path.write_text(gmsh_text())
    return path


def keys_of(path, inclusions):
    keys = f"mesh: {path}, clamped: ['-x']"
    return rig_of(f"{keys}, inclusions: {inclusions}".replace(";", ","))


def test_groups_of_tetrahedra_are_bodies_each_tetrahedron_once(bar):
    mesh = read_mesh(bar)
    inside = middle_of(mesh)
    assert dict(mesh.bodies)["tumour"] == tuple(inside)
    assert len(inside) == 10
    # Gmsh writes what is of two groups once for each.
    both = gmsh_mesh(gmsh_text(twice=inside), "both.msh")
    assert both.tetrahedra == mesh.tetrahedra
    assert dict(both.bodies)["tumour"] == tuple(inside)
    assert len(dict(both.bodies)["body"]) == len(mesh.tetrahedra)
    # One that is really there twice is still refused.
    text = gmsh_text()
    line = next(one for one in text.split("\n") if one.startswith("2 4 2 "))
    number = len([one for one in text.split("\n") if " 4 2 " in one]) + 2
    text = text.replace("$EndElements", f"{number}{line[1:]}\n$EndElements")
    text = text.replace(f"$Elements\n{number - 1}\n", f"$Elements\n{number}\n")
    with pytest.raises(ValueError, match="one is there twice"):
        gmsh_mesh(text, "it.msh")


def test_other_readers_have_the_same_bodies(bar, tmp_path):
    meshio = pytest.importorskip("meshio")
    found = meshio.read(bar)
    for kind, name in (("gmsh22", "binary.msh"),):
        meshio.write(tmp_path / name, found, file_format=kind, binary=True)
        assert read_mesh(tmp_path / name).bodies == read_mesh(bar).bodies


def test_a_bar_in_series_stretches_by_the_sum_of_its_parts(bar):
    """Poisson's ratio 0: the displacement F / A times the integral of dx / E is exact."""
    keys = keys_of(bar, f"{{tumour: {{young: {STIFF}}}}}").scene.tissues["beam"]
    keys = keys.model_copy(update={"young": YOUNG, "poisson": 0.0})
    mesh = read_mesh(bar)

    def matrix(inclusions):
        materials = materials_of(keys.model_copy(update={"inclusions": inclusions}), mesh)
        made = tissue_of("b", mesh, materials, on_faces(mesh, ["-x"]))
        return made, stiffness_of(
            Network3d(made.masses, (), (), made.grounds, elements=made.elements)
        )

    made, stiffness = matrix(keys.inclusions)
    places = np.array([one.position for one in made.masses])

    def stretch(x):
        soft = np.minimum(x, 0.04) + np.maximum(x - 0.08, 0.0)
        return soft / YOUNG + np.clip(x - 0.04, 0.0, 0.04) / STIFF

    moved = np.zeros_like(places)
    moved[:, 0] = stretch(places[:, 0]) / (SIZE[1] * SIZE[2])  # of 1 N
    forces = (stiffness @ moved.ravel()).reshape(-1, 3)
    end = np.isclose(places[:, 0], SIZE[0])
    assert forces[end, 0].sum() == pytest.approx(1.0, rel=1e-9)
    assert np.abs(forces[~end]).max() < 1e-9
    _, uniform = matrix({})
    assert np.abs((uniform @ moved.ravel()).reshape(-1, 3)[~end]).max() > 0.1


def test_what_an_inclusion_does_not_state_is_the_tissues(bar):
    heavy = keys_of(bar, "{tumour: {young: 1e5;density: 3000}}")
    plain = keys_of(bar, "{tumour: {young: 1e5}}")
    mesh = read_mesh(bar)
    each = [[mesh.nodes[node] for node in one] for one in mesh.tetrahedra]
    inside = sum(shape_of(each[at], "")[1] for at in middle_of(mesh))
    weights = [
        sum(one.mass for one in pruned_network3d(rig).network.masses if one.name[:4] == "beam")
        for rig in (heavy, plain)
    ]
    density = plain.scene.tissues["beam"].density
    assert weights[0] - weights[1] == pytest.approx((3000.0 - density) * inside, rel=1e-9)
    ((_, text),) = tissue_facts(heavy)
    assert f"{density * 4e-5 + (3000.0 - density) * inside:.3g} kg" in text
    said = next(line.why for line in plan(heavy) if line.element == "tissue beam")
    assert "10 of them (tumour) of 100000 Pa" in said


@pytest.mark.parametrize(
    ("inclusions", "said"),
    [
        ("{stone: {young: 1e5}}", "'stone' is no physical group of the mesh; .*: body, tumour"),
        ("{root: {young: 1e5}}", "'root' is a physical group without tetrahedra"),
        ("{tumour: {young: -1}}", "young"),
        ("{tumour: {density: 900}}", "young"),
    ],
)
def test_what_is_no_inclusion_is_refused_by_its_name(bar, inclusions, said):
    with pytest.raises(ConfigError, match=said):
        keys_of(bar, inclusions)


def test_two_inclusions_share_no_tetrahedron(tmp_path):
    path = tmp_path / "both.msh"
    path.write_text(gmsh_text(twice=middle_of(block(SIZE, CELLS))))
    with pytest.raises(ConfigError, match="'tumour' and 'body' both have tetrahedron"):
        keys_of(path, "{tumour: {young: 1e5};body: {young: 2e4}}")
    assert keys_of(path, "{tumour: {young: 1e5}}")


def test_a_block_has_no_groups():
    box = "block: {size: [0.1,0.02,0.02],cells: [4,1,1]}"
    with pytest.raises(ConfigError, match=r"'tumour' is no physical group.*: none"):
        rig_of(f"{box}, inclusions: {{tumour: {{young: 1e5}}}}")
