import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxrot.scenes.contact import Motion, build_contact, stand_on_ground, stay_in_box, stay_out_of_obstacle

BOX = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))


def moved(answer, position, velocity, **contact):
    motion = Motion(jnp.asarray([position], jnp.float32), jnp.asarray([velocity], jnp.float32))
    after = jax.jit(answer)(motion, build_contact(**contact))
    assert {array.dtype for array in after} == {jnp.float32.dtype}
    return [np.asarray(array[0]).tolist() for array in after]


def test_a_point_under_the_ground_bounces_and_slides_as_coulomb_says():
    position, velocity = moved(
        stand_on_ground, (5, 6, -0.25), (3, 4, -2), ground_height=1.0, restitution=0.5, friction=0.5
    )
    assert position == [5, 6, 1]
    # The normal velocity changes by 3, the tangential one of 5 loses half of that.
    assert velocity == pytest.approx([3 * 0.7, 4 * 0.7, 1])


def test_friction_stops_a_point_and_does_not_turn_it_back():
    assert moved(stand_on_ground, (0, 0, -1), (1, 0, -2), ground_height=0.0, friction=9.0)[1] == [0, 0, 0]


def test_a_point_that_leaves_the_ground_or_is_above_it_is_let_go():
    assert moved(stand_on_ground, (0, 0, -1), (1, 0, 2), ground_height=0.0) == [[0, 0, 0], [1, 0, 2]]
    assert moved(stand_on_ground, (0, 0, 1), (1, 0, -2), ground_height=0.0) == [[0, 0, 1], [1, 0, -2]]


def test_a_point_outside_the_box_comes_back_to_its_wall():
    assert moved(stay_in_box, (2, 0.5, 0), (3, 0, 0), box=BOX) == [[1, 0.5, 0], [0, 0, 0]]
    assert moved(stay_in_box, (0.5, -0.5, 0), (3, 1, 0), box=BOX) == [[0.5, -0.5, 0], [3, 1, 0]]


def test_a_point_in_the_obstacle_leaves_through_the_nearest_face():
    out = moved(stay_out_of_obstacle, (0.5, -0.75, 0), (0, 3, 0), obstacle=BOX)
    assert out == [[0.5, -1, 0], [0, 0, 0]]
    assert moved(stay_out_of_obstacle, (0.5, -1.5, 0), (0, 3, 0), obstacle=BOX) == [[0.5, -1.5, 0], [0, 3, 0]]


def test_what_is_not_given_is_touched_nowhere_and_has_a_finite_derivative():
    contact = build_contact()

    def after(position):
        motion = Motion(position, 2 * position)
        for answer in (stand_on_ground, stay_in_box, stay_out_of_obstacle):
            motion = answer(motion, contact)
        return motion

    position = jnp.asarray([[1.0, -2.0, 3.0]], jnp.float32)
    assert (jax.jit(after)(position).positions == position).all()
    gradient = jax.jit(jax.grad(lambda x: jnp.sum(after(x).velocities)))(position)
    np.testing.assert_array_equal(gradient, jnp.full((1, 3), 2, jnp.float32))


@pytest.mark.parametrize(
    "wrong",
    [
        {"box": BOX[::-1]},
        {"box": ((0.0, 0.0), (1.0, 1.0))},
        {"obstacle": ((np.nan,) * 3, (1.0,) * 3)},
        {"ground_height": np.nan},
        {"restitution": 1.5},
        {"friction": -1.0},
    ],
    ids=str,
)
def test_a_wrong_contact_is_refused_in_one_line(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))) as error:
        build_contact(**wrong)
    assert "\n" not in str(error.value)
