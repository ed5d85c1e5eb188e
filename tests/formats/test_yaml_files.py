import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from polarsim.config import render_options
from polarsim.errors import ConfigError
from polarsim.formats.yaml_files import parse_yaml, read_yaml

NAMES = st.text("abcdefgh_", min_size=1, max_size=5)
PLAIN = st.recursive(
    st.integers(-(10**9), 10**9) | st.booleans() | st.none() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
    max_leaves=8,
)


@given(content=st.dictionaries(NAMES, PLAIN, max_size=4), flow=st.booleans())
def test_the_output_of_pyyaml_reads_back(content, flow):
    assert parse_yaml(yaml.safe_dump(content, default_flow_style=flow)) == content


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a: 1\nb: 2\na: 3\n", 3),
        ("labels:\n  seeds: {}\nrun: x\nlabels:\n  excluded_annotations: []\n", 4),
        ("a: {b: 1, b: 1}", 1),
        ("a:\n  - b: 1\n    c: 2\n    b: 1\n", 4),
        ("a: &x {b: {c: 1, 'c': 2}}\nd: *x\n", 1),
        ("1: a\n1: b\n", 2),
    ],
)
def test_a_repeated_key_is_an_error_with_the_line(tmp_path, text, line):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_yaml(path)
    assert (caught.value.path, caught.value.line) == (path, line)


def test_merge_keys_and_aliases_are_no_repeated_keys():
    text = "base: &base {a: 1, b: 2}\nmine:\n  <<: *base\n  b: 3\nalso: *base\n"
    assert parse_yaml(text) == {"base": {"a": 1, "b": 2}, "mine": {"a": 1, "b": 3}, "also": {"a": 1, "b": 2}}


@pytest.mark.parametrize("number", ["010", "08", "0064", "-010", "+07", "00", "0_1", "1:30", "10:30:00", "1:30.5"])
@pytest.mark.parametrize("text", ["{}", "a: {}", "[1, {}]", "{}: 1", "a:\n- 1\n- b: {}\n"])
def test_numbers_that_yaml_reads_in_another_base_are_errors(number, text):
    with pytest.raises(ConfigError) as caught:
        parse_yaml(text.replace("{}", number))
    assert number in caught.value.reason
    quoted = text.replace("{}", f"'{number}'")
    assert str(number) in str(parse_yaml(quoted))


@pytest.mark.parametrize("text", ["0", "-0", "0.5", "1e3", "0e0", "2026-11-27", "01_A_off_180_L_0256", "0256.png"])
def test_other_plain_values_with_zeros_are_unchanged(text):
    assert parse_yaml(text) == yaml.safe_load(text)


def test_values_on_the_command_line_follow_the_same_rules():
    with pytest.raises(ConfigError):
        render_options(["samples=04"])


@pytest.mark.parametrize("text", ["a: &a [*a]\n", "a: &a {b: *a}\n", "&a [1, [*a]]\n"])
def test_a_value_that_contains_itself_is_an_error(text):
    with pytest.raises(ConfigError) as error:
        parse_yaml(text)
    assert "\n" not in str(error.value)
