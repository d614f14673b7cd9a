import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.run.nested import flat, merged, nested, value_at, within

NAMES = st.text("abc", min_size=1, max_size=2)
TREES = st.dictionaries(
    NAMES, st.recursive(st.integers(), lambda inner: st.dictionaries(NAMES, inner, min_size=1, max_size=3)), max_size=3
)


@given(TREES)
def test_flat_and_nested_are_inverse(tree):
    assert nested(flat(tree)) == tree


@given(TREES)
def test_every_path_leads_to_its_value(tree):
    assert all(value_at(tree, path) == value for path, value in flat(tree).items())


def test_changes_leave_what_stands_beside_them():
    values = {"training": {"steps": 5, "head": {"name": "a", "hidden": 8}}}
    assert merged(values, within("training.head.hidden", 9)) == {
        "training": {"steps": 5, "head": {"name": "a", "hidden": 9}}
    }
    assert values["training"]["head"]["hidden"] == 8


@pytest.mark.parametrize(("path", "missing"), [("a.x.y", "a.x"), ("a.b.c", "a.b.c"), ("z", "z")])
def test_a_path_that_leads_nowhere_is_named_as_far_as_it_went(path, missing):
    with pytest.raises(KeyError, match=missing.replace(".", r"\.")):
        value_at({"a": {"b": 1}}, path)
