import meshio
import numpy as np
import pytest

from jaxrot.scenes import tetrahedra
from jaxrot.scenes.tetrahedra import box, checked, read

UNIT = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
ONE = np.array([[0, 1, 2, 3]])


def test_a_box_is_filled_without_gaps_and_has_the_mass_of_its_volume():
    mesh = box((3, 2, 4), (1.5, 1.0, 0.5))
    volumes = tetrahedra.volumes(mesh)
    assert len(mesh.tetrahedra) == 6 * 3 * 2 * 4
    np.testing.assert_allclose(volumes, 0.75 / len(volumes))
    np.testing.assert_allclose(tetrahedra.lumped_masses(mesh, 2.0).sum(), 1.5)
    # Neighbours share whole faces: the boundary's edges are those of the rectangles and one diagonal each.
    rectangles = 2 * (3 * 2 + 2 * 4 + 3 * 4)
    assert len(tetrahedra.surface_edges(mesh)) == 3 * rectangles
    with pytest.raises(ValueError, match="at least one cell"):
        box((0, 1, 1), (1, 1, 1))
    with pytest.raises(ValueError, match="positive length"):
        box((1, 1, 1), (1, 0, 1))


@pytest.mark.parametrize("scale", [1e-9, 1, 1e9])
def test_either_orientation_is_taken_at_any_unit(scale):
    for corners in (ONE, ONE[:, ::-1]):
        np.testing.assert_allclose(tetrahedra.volumes(checked(UNIT * scale, corners)), scale**3 / 6)


@pytest.mark.parametrize(
    ("vertices", "corners", "message"),
    [
        (UNIT, np.zeros((0, 4), int), "the mesh has no tetrahedra"),
        (UNIT, ONE[:, :3], "tetrahedra must be integers of shape"),
        (UNIT, ONE.astype(float), "tetrahedra must be integers of shape"),
        (UNIT[:, :2], ONE, "vertices must have shape"),
        (np.where(UNIT == 1, np.nan, UNIT), ONE, "vertices must be finite; vertex 1 is"),
        (UNIT, ONE + 1, "names a vertex outside 0 to 3"),
        (np.concatenate([UNIT, UNIT[:1]]), ONE, "vertex 4 belongs to no tetrahedron"),
        (UNIT * [1, 1, 0], ONE, "tetrahedron 0 is flat, 1 of 1 are"),
        (UNIT[[0, 1, 2, 2]], ONE, "tetrahedron 0 is flat"),
    ],
)
def test_an_unusable_mesh_is_refused_in_one_line(vertices, corners, message):
    with pytest.raises(ValueError, match=message) as refusal:
        checked(vertices, corners)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("ending", ["vtk", "msh", "vtu"])
def test_a_file_of_the_users_is_read_without_its_loose_vertices(tmp_path, ending):
    mesh = box((2, 1, 1), (2, 1, 1))
    path = tmp_path / f"mesh.{ending}"
    points = np.concatenate([[[9.0, 9, 9]], mesh.vertices])
    cells = [("triangle", mesh.tetrahedra[:1, :3] + 1), ("tetra", mesh.tetrahedra + 1)]
    meshio.write(path, meshio.Mesh(points, cells))
    found = read(path)
    np.testing.assert_array_equal(found.vertices, mesh.vertices)
    np.testing.assert_array_equal(found.tetrahedra, mesh.tetrahedra)


def test_a_file_that_is_no_mesh_of_tetrahedra_is_refused_in_one_line(tmp_path, capsys):
    meshio.write(tmp_path / "surface.vtk", meshio.Mesh(UNIT, [("triangle", ONE[:, :3])]))
    for name in ("broken.msh", "notes.txt"):
        (tmp_path / name).write_text("no mesh\n")
    messages = {"surface.vtk": "has no tetrahedra; its cells: triangle", "absent.vtk": "not found"}
    for name, message in (messages | dict.fromkeys(("broken.msh", "notes.txt"), "the mesh cannot be read")).items():
        with pytest.raises(ValueError, match=message) as refusal:
            read(tmp_path / name)
        assert "\n" not in str(refusal.value)
    assert capsys.readouterr() == ("", "")
