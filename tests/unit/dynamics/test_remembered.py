"""What is made of a model is remembered by the object."""

from asvhil.dynamics.remembered import MODELS, by_model


class AlwaysEqual:
    """A model of a plug-in, which has no hash and is equal to any."""

    def __eq__(self, other: object) -> bool:
        return True


def test_each_object_has_its_own_and_the_last_few_are_kept():
    made = []

    @by_model
    def make(model: object, number: int = 0) -> object:
        made.append((model, number))
        return object()

    first, second = AlwaysEqual(), AlwaysEqual()
    one = make(first)
    assert make(first) is one and make(second) is not one and make(first, 2) is not one
    assert make(first) is one and len(made) == 3
    for _ in range(MODELS):
        make(AlwaysEqual())
    assert make(first) is not one
