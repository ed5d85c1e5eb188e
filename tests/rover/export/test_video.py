"""Videos of a drive: names, frame rate, boxes, and equal bytes."""

import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from polarsim.errors import RoverError
from polarsim.formats import png, tables
from polarsim.rover.cameras.frames import render_frames
from polarsim.rover.cameras.layout import picture_folder
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.drive.trace import write_trace
from polarsim.rover.export.video import (
    frame_rate,
    video_name,
    with_boxes,
    write_video,
    write_videos,
)
from polarsim.rover.perception.detections import detection_table
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.tone import to_8bit
from tests.rover import driven


def test_videos_are_named_as_in_the_paper():
    assert video_name(FRONT, "3", "hapke", 256) == "front_end_cam_3_hapke_0256.webm"
    assert video_name("CamBirdViewLeft", "1", "principled", 1024) == "CamBirdViewLeft_1_default_1024.webm"
    assert frame_rate(np.arange(30) / 15, 0.5) == Fraction(15, 2)  # half speed


def test_boxes_of_rocks_are_orange_and_of_shadows_blue():
    boxes = pd.DataFrame(
        {"kind": ["rock", "shadow"], "confidence": 0.9, "x0": [10, 50], "y0": 20, "x1": [30, 80], "y1": 40}
    )
    before = np.zeros((60, 100, 3), np.uint8)
    after = with_boxes(before, boxes)
    assert not before.any()
    red, _, blue = after[30, 10]
    assert red > blue
    red, _, blue = after[30, 50]
    assert blue > red


@pytest.fixture
def av():
    return pytest.importorskip("av")


def read(av, path):
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        return (
            stream.codec_context.name,
            stream.average_rate,
            [f.to_ndarray(format="rgb24") for f in container.decode()],
        )


def moving(frames=12):
    y, x = np.mgrid[:96, :161]
    for n in range(frames):
        yield np.repeat((((x + 4 * n) // 16 + y // 16) % 2 * 200).astype(np.uint8)[..., None], 3, axis=2)


def test_a_video_reads_back(av, tmp_path):
    path = tmp_path / "a.webm"
    write_video(path, moving(), Fraction(15, 2))
    codec, rate, pictures = read(av, path)
    assert "av1" in codec or "dav1d" in codec
    assert rate == Fraction(15, 2)
    assert len(pictures) == 12
    for decoded, expected in zip(pictures, moving(), strict=True):
        assert np.abs(decoded.astype(int) - expected[:, :160]).mean() < 8


@pytest.mark.skipif(not hasattr(os, "sched_getscheduler"), reason="only Linux has this function")
def test_encoding_does_not_change_the_priority_of_threads(av, tmp_path):
    def policies():
        return {os.sched_getscheduler(int(thread.name)) for thread in Path("/proc/self/task").iterdir()}

    def pictures():
        for _ in range(3):
            yield np.zeros((64, 64, 3), np.uint8)
            during.append(policies())  # the encoder is running

    during = []
    write_video(tmp_path / "video.webm", pictures(), Fraction(5))
    assert [*during, policies()] == [{os.SCHED_OTHER}] * 4
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda name: write_video(tmp_path / name, moving(), Fraction(5)), ("a.webm", "b.webm")))
        assert policies() == {os.SCHED_OTHER}


def test_an_error_leaves_no_file(av, tmp_path):
    with pytest.raises(RoverError):
        write_video(tmp_path / "a.webm", [], Fraction(10))
    assert list(tmp_path.iterdir()) == []


def test_the_number_of_threads_does_not_change_videos_and_detections_appear(av, tmp_path):
    write_trace(tmp_path, driven.trace(seconds=1.0))
    options = CameraSuiteOptions(views=(FRONT,), suns=("2",), models=("hapke",), scale=0.1, finer=1)
    render_frames(tmp_path, driven.vehicle(), options, 0, render=driven.RENDER)
    made = []
    for threads in (1, 3):
        write_videos(tmp_path, driven.vehicle(), options, 0, threads)
        made.append({path.name: path.read_bytes() for path in (tmp_path / "videos").iterdir()})
        shutil.rmtree(tmp_path / "videos")
    assert len(made[0]) == 3
    assert made[0] == made[1]
    options, path = options.model_copy(update={"exposures_ms": (512,)}), tmp_path / "front_end_cam_2_hapke_0512.webm"
    path.write_bytes(made[0][path.name])
    plain = read(av, path)[2]
    pictures = picture_folder(tmp_path, FRONT, "2", "hapke", 512)
    full_range = to_8bit(png.read_png(pictures / "00003.png"), 4095 - 16)[:122, :194]
    assert np.abs(plain[3].astype(int) - full_range).mean() < 4
    detections = detection_table([(frame, "rock", 0.9, 40, 30, 90, 80) for frame in range(6)])
    tables.write_parquet(pictures / "detections.parquet", detections)
    write_videos(tmp_path, driven.vehicle(), options, 0)
    orange = read(av, tmp_path / "videos" / path.name)[2][3].astype(int)
    assert (orange[..., 0] - orange[..., 2]).max() > 60 > np.abs(plain[3][..., 0].astype(int) - plain[3][..., 2]).max()


def test_the_error_of_a_missing_picture_has_its_path(tmp_path):
    write_trace(tmp_path, driven.trace(seconds=0.2))
    options = CameraSuiteOptions(views=(FRONT,), suns=("2",), models=("hapke",), exposures_ms=(512,), scale=0.1)
    with pytest.raises(RoverError, match=r"00000\.png"):
        write_videos(tmp_path, driven.vehicle(), options, 0)
