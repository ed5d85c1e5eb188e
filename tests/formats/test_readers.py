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


@pytest.mark.parametrize(
    ("convert", "text", "reason"),
    [
        (float, "0,5", "'0,5' is not a number, write a decimal point"),
        (float, "2000,", "'2000,' is not a number, separate numbers by spaces"),
        (float, "#", "'#' is not a number"),
        (int, "1.0", "'1.0' is not a whole number"),
    ],
)
def test_a_text_that_is_no_number_is_named_with_a_remedy(tmp_path, convert, text, reason):
    @reader("thing")
    def read(path, known):
        try:
            convert(text)
        except ValueError as error:
            if not known:
                raise
            raise FormatError(f"FIELD: {error}") from error

    for known in (False, True):
        with pytest.raises(FormatError) as caught:
            read(tmp_path / "a.txt", known)
        assert reason in caught.value.reason
        assert "convert" not in caught.value.reason
