import pytest

from polarsim.errors import ConfigError, FormatError
from polarsim.formats.readers import reader


@pytest.mark.parametrize(
    "failure",
    [
        ValueError("two\nlines"),
        KeyError("a"),
        OSError(5, "input/output"),
        MemoryError(),
        FormatError("a\nb"),
        Exception(),
    ],
)
def test_every_exception_of_a_reader_becomes_a_single_line_with_the_file(tmp_path, failure):
    @reader("thing", error=ConfigError)
    def read(path):
        raise failure

    with pytest.raises(FormatError if isinstance(failure, FormatError) else ConfigError) as caught:
        read(tmp_path / "a.txt")
    assert caught.value.path == tmp_path / "a.txt"
    assert len(str(caught.value).splitlines()) == 1


def test_a_file_above_the_size_limit_and_an_interruption(tmp_path):
    @reader("thing", largest_mb=0.001)
    def read(path):
        raise KeyboardInterrupt

    (tmp_path / "a.txt").write_bytes(b"0" * 1001)
    with pytest.raises(FormatError, match="MB"):
        read(tmp_path / "a.txt")
    with pytest.raises(KeyboardInterrupt):
        read(tmp_path / "none.txt")
