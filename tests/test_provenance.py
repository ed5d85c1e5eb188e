"""Identity notes of outputs."""

import pytest

from polarsim.provenance import identity, is_current, store_identity


def test_an_output_is_current_until_inputs_options_or_code_change(tmp_path, monkeypatch):
    source, output = tmp_path / "in.txt", tmp_path / "out.txt"
    source.write_text("one")
    first = identity("polarsim.provenance", [source], "option")
    assert not is_current(output, first)
    with store_identity(output, first):
        output.write_text("made")
    assert is_current(output, first)
    assert not is_current(output, identity("polarsim.provenance", [source], "other option"))
    source.write_text("two")
    assert not is_current(output, identity("polarsim.provenance", [source], "option"))
    source.write_text("one")
    monkeypatch.setattr("polarsim.provenance.code_digest", lambda module: f"other code of {module}")
    assert not is_current(output, identity("polarsim.provenance", [source], "option"))
    output.unlink()
    assert not is_current(output, first)


def test_a_failed_output_is_not_current_even_for_its_former_identity(tmp_path):
    output = tmp_path / "out.txt"
    with store_identity(output, "one"):
        output.write_text("made")
    with pytest.raises(OSError), store_identity(output, "two"):  # noqa: PT011, PT012
        output.write_text("half")
        raise OSError
    assert not is_current(output, "one")
    assert not is_current(output, "two")
