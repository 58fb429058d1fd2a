"""Makes an FMU of the controller in this folder, with a binary for this machine.

    python examples/pole_controller/build.py pole_controller.fmu
    cutjoint couple examples/cart_pole.yaml pole_controller.fmu --out balanced.csv \\
        --connect position=cart.x --connect angle=pin.angle --connect force=push
"""

import shutil
import sys
import tempfile
from pathlib import Path

from fmpy.build import build_platform_binary

fmu, here = Path(sys.argv[1]), Path(__file__).parent
with tempfile.TemporaryDirectory() as place:
    folder = Path(shutil.copytree(here, Path(place) / "fmu", ignore=shutil.ignore_patterns("*.py", "__pycache__")))
    build_platform_binary(folder)
    archive = shutil.make_archive(str(Path(place) / fmu.stem), "zip", folder)
    shutil.move(archive, fmu)
