import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxrot.scenes.contact import Motion, build_contact, stand_on_ground, stay_in_box, stay_out_of_obstacle

BOX = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))


GROUND = {"ground_height": 0.0}
ANSWERS = {
    # The normal velocity changes by 3, the tangential one of 5 loses half of that.
    "bounces and slides as Coulomb says": (
        stand_on_ground, [(5, 6, -0.25), (3, 4, -2)], [(5, 6, 1), (2.1, 2.8, 1)],
        {"ground_height": 1.0, "restitution": 0.5, "friction": 0.5},
    ),
    "is stopped by friction": (
        stand_on_ground, [(0, 0, -1), (1, 0, -2)], [(0, 0, 0), (0, 0, 0)], {"ground_height": 0.0, "friction": 9.0},
    ),
    "leaves the ground": (stand_on_ground, [(0, 0, -1), (1, 0, 2)], [(0, 0, 0), (1, 0, 2)], GROUND),
    "above the ground": (stand_on_ground, [(0, 0, 1), (1, 0, -2)], [(0, 0, 1), (1, 0, -2)], GROUND),
    "comes back to the wall": (stay_in_box, [(2, 0.5, 0), (3, 0, 0)], [(1, 0.5, 0), (0, 0, 0)], {"box": BOX}),
    "in the box": (stay_in_box, [(0.5, -0.5, 0), (3, 1, 0)], [(0.5, -0.5, 0), (3, 1, 0)], {"box": BOX}),
    "leaves through the nearest face": (
        stay_out_of_obstacle, [(0.5, -0.75, 0), (0, 3, 0)], [(0.5, -1, 0), (0, 0, 0)], {"obstacle": BOX},
    ),
    "beside the obstacle": (
        stay_out_of_obstacle, [(0.5, -1.5, 0), (0, 3, 0)], [(0.5, -1.5, 0), (0, 3, 0)], {"obstacle": BOX},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ANSWERS)
def test_a_point_is_answered(name):
    answer, before, expected, contact = ANSWERS[name]
    motion = Motion(*(jnp.asarray([x], jnp.float32) for x in before))
    after = jax.jit(answer)(motion, build_contact(**contact))
    assert {array.dtype for array in after} == {jnp.float32.dtype}
    np.testing.assert_allclose(np.asarray(after)[:, 0], expected, rtol=1e-6 if "Coulomb" in name else 0)


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
