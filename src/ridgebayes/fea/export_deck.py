"""`export_deck`: a scene as an input deck of another program."""

import os
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.fea.deck_text import PressedDisk, deck_text, pressed_disk
from ridgebayes.runtime.atomic import write_text
from ridgebayes.scene.scene import Scene


def export_deck(
    scene: Scene | str | os.PathLike[str],
    program: str,
    path: str | os.PathLike[str],
    *,
    edges: float = 12.0,
) -> PressedDisk:
    """Write a scene as an input deck for other finite elements, as ``ridgebayes export-deck``.

    Parameters
    ----------
    scene : Scene or path
        Scene of one texture, with the body centred over a groove, or its file.
    program : {"calculix", "abaqus"}
        Program that reads the deck.
    path : path
        File to write; one that is there is replaced.
    edges : float, optional
        Element edges over a ridge's width.

    Returns
    -------
    PressedDisk
        The disk that was written: nodes, cells, displacements of its levels, in units of R.

    Raises
    ------
    InputError
        If the scene has several textures, or effects that a deck cannot hold.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import ridgebayes as rb
    >>> scene = rb.Scene.of([(0.06, 0.03)], p_over_E=0.002, nu=0.49)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     disk = rb.export_deck(scene, "calculix", f"{folder}/run.inp")
    ...     text = Path(folder, "run.inp").read_text()
    >>> "*STEP" in text, len(disk.cells) > 100
    (True, True)
    """
    if isinstance(scene, str | os.PathLike):
        where, scene = f"{scene}: ", Scene.from_toml(scene)
    else:
        where = ""
    try:
        disk = pressed_disk(scene, edges=edges)
        text = deck_text(disk, program)
    except InputError as error:
        raise InputError(f"{where}{error}") from None
    write_text(text, Path(path))
    return disk
