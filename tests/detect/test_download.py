import hashlib

import pytest

from polarsim.detect.detectors.download import ensure_weights
from polarsim.detect.options import TrainingOptions
from polarsim.errors import FetchError

CONTENT = b"weights"
DIGEST = hashlib.sha256(CONTENT).hexdigest()


@pytest.fixture
def address(tmp_path):
    (tmp_path / "there.pt").write_bytes(CONTENT)
    return (tmp_path / "there.pt").as_uri()


def options(tmp_path, address, digest=DIGEST):
    return TrainingOptions(pretrained=tmp_path / "here" / "w.pt", pretrained_url=address, pretrained_sha256=digest)


def test_missing_weights_are_fetched_once(tmp_path, address):
    ensure_weights(options(tmp_path, address))
    assert (tmp_path / "here" / "w.pt").read_bytes() == CONTENT
    (tmp_path / "there.pt").unlink()
    ensure_weights(options(tmp_path, address))  # there now: the address is not asked again


def test_other_weights_than_pinned_are_refused_and_not_kept(tmp_path, address):
    with pytest.raises(FetchError, match=f"SHA-256 {DIGEST}, expected {'0' * 64}"):
        ensure_weights(options(tmp_path, address, "0" * 64))
    assert list((tmp_path / "here").iterdir()) == []


def test_an_address_that_gives_nothing_is_named(tmp_path, address):
    with pytest.raises(FetchError, match=r"absent\.pt"):
        ensure_weights(options(tmp_path, address.replace("there", "absent")))


def test_without_an_address_nothing_is_fetched(tmp_path):
    ensure_weights(TrainingOptions(pretrained=tmp_path / "w.pt"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "given",
    [
        {"pretrained_url": "https://example.org/w.pt", "pretrained_sha256": DIGEST},
        {"pretrained": "w.pt", "pretrained_url": "https://example.org/w.pt"},
        {"pretrained": "w.pt", "pretrained_url": "http://example.org/w.pt", "pretrained_sha256": DIGEST},
    ],
)
def test_an_address_needs_a_place_a_checksum_and_a_safe_protocol(given):
    with pytest.raises(ValueError, match="pretrained_"):
        TrainingOptions(**given)
