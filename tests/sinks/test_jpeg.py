"""Pictures as JPEG, against two libraries that read them."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from seerob.outputs.picture.jpeg import jpeg


def smooth(height, width):
    y, x = np.mgrid[:height, :width]
    return np.stack([x * 255 // width, y * 255 // height, (x + y) % 256], -1).astype(np.uint8)


@pytest.mark.parametrize("size", [(8, 8), (1, 1), (97, 131), (360, 640)])
def test_others_read_what_was_drawn(size):
    rng = np.random.default_rng(size[0])
    drawn = smooth(*size)
    drawn[size[0] // 3 :, size[1] // 3 :] = rng.integers(0, 256, 3)
    data = jpeg(drawn)
    by_opencv = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1].astype(float)
    by_pillow = np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(float)
    for read in (by_opencv, by_pillow):
        assert read.shape == drawn.shape
        assert np.sqrt(np.mean((read - drawn) ** 2)) < 5.0


@pytest.mark.parametrize(
    "drawn",
    [
        np.random.default_rng(1).integers(0, 256, (64, 72, 3)).astype(np.uint8),
        np.kron(np.indices((8, 9)).sum(axis=0) % 2 * 255, np.ones((8, 8))).astype(np.uint8)[..., None]
        * np.ones(3, np.uint8),
        np.zeros((16, 16, 3), np.uint8),
    ],
    ids=["noise", "largest steps", "black"],
)
def test_the_extremes_of_coefficients_have_codes(drawn):
    read = cv2.imdecode(np.frombuffer(jpeg(drawn), np.uint8), cv2.IMREAD_COLOR)[..., ::-1].astype(float)
    assert np.sqrt(np.mean((read - drawn) ** 2)) < 6.0
