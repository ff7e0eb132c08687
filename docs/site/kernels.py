"""Settings of the kernels that run the notebooks, and when they run them again."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

_SETTINGS = """\
c = get_config()
c.HistoryManager.enabled = False
c.IPKernelApp.log_level = 40
c.InlineBackend.figure_formats = ["svg"]
"""


def kernel_settings(folder: Path) -> Path:
    """Write the settings to a folder for the variable ``IPYTHONDIR``, and return it."""
    profile = folder / "profile_default"
    profile.mkdir(parents=True, exist_ok=True)
    (profile / "ipython_kernel_config.py").write_text(_SETTINGS)
    return folder


def fingerprint(package: Path) -> str:
    """Return a hash of all code and documents that a notebook's output may depend on."""
    found = sha256()
    # Through the links to diagrams/ and models/ as well.
    for room in sorted(file for file in package.iterdir() if file.name != "__pycache__"):
        files = [room] if room.is_file() else sorted(room.rglob("*.*"))
        for file in files:
            if file.suffix in (".py", ".yaml", ".urdf", ".html", ".js", ".css"):
                found.update(str(file.relative_to(package)).encode() + file.read_bytes())
    return found.hexdigest()[:16]
