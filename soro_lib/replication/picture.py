"""What the finished picture of a figure says about itself, read without matplotlib."""

from pathlib import Path

from PIL import Image

DIGEST = "Digest"
"""Name of the text chunk that holds the digest of what the picture shows."""


def stored_digest(path: Path) -> str | None:
    """Return the digest that a PNG was saved with, without decoding its pixels.

    Returns
    -------
    str or None
        As `soro_lib.replication.recording.Recording.digest`; None if there is no such file, if it is no
        whole PNG, or if it has no digest.
    """
    try:
        with Image.open(path, formats=["PNG"]) as image:
            digest = image.info.get(DIGEST)
            image.verify()  # the checksums of all chunks
    except (OSError, SyntaxError, ValueError):  # what Pillow raises for a damaged file
        return None
    return digest
