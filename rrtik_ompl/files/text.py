"""Reading and writing text files: a failure is one line that names the file; a file is written whole or not at all."""

from __future__ import annotations

import os
import stat
from difflib import get_close_matches
from errno import EDQUOT, EFBIG, ENOSPC
from pathlib import Path

from rrtik_ompl.base.errors import InputError

MAX_BYTES = 64 * 1024 * 1024  # far above any problem or path file; keeps /dev/zero from filling the memory


def read_text(path: str | os.PathLike[str], limit: int = MAX_BYTES) -> str:
    """Contents of a UTF-8 text file of at most ``limit`` bytes.

    Raises:
        InputError: If the file is missing, a folder, unreadable, too large, or not UTF-8 text.
    """
    data = read_bytes(path, limit)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: not a text file (byte {data[error.start]:#04x} at offset {error.start}); expected UTF-8 text"
        ) from error


def read_bytes(path: str | os.PathLike[str], limit: int = MAX_BYTES) -> bytes:
    """Contents of a file of at most ``limit`` bytes.

    Raises:
        InputError: If the file is missing, a folder, unreadable or too large.
    """
    file_name(path)
    try:
        with open(path, "rb") as file:
            length = os.fstat(file.fileno()).st_size  # 0 of devices and pipes
            data = file.read(limit + 1) if length <= limit else b""
    except FileNotFoundError:
        raise InputError(f"{path}: no such file{_similar(Path(path))}") from None
    except IsADirectoryError:
        raise InputError(f"{path}: this is a folder; give a file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error

    length = max(length, len(data))
    if length > limit:
        most = limit // 2**20
        size = length // 2**20
        shown = f"{size} MiB, more" if size > most else "larger"
        raise InputError(f"{path}: {shown} than {most} MiB, the most that is read")
    return data


def _similar(path: Path) -> str:
    """Return a hint at a file of nearly the same name in the same folder."""
    try:
        near = get_close_matches(path.name, os.listdir(path.parent), n=1, cutoff=0.8)
    except (OSError, ValueError):
        return f"; folder '{path.parent}' does not exist"
    return f"; did you mean '{near[0]}'?" if near else "; check the name"


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a UTF-8 text file whole or not at all, see :func:`write_bytes`.

    Raises:
        InputError: If the folder does not exist or the file cannot be written.
    """
    try:
        data = text.encode("utf-8")
    except UnicodeEncodeError as error:
        half = text[error.start]  # which the error spells out
        raise InputError(f"{path}: cannot be written: a name in it holds {half}, half a letter; rename it") from None
    write_bytes(path, data)


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file so that an interruption leaves the old file or the new one, never a half.

    The data goes to a temporary name in the same folder, which then takes the place of the old file, and its mode.
    Devices and pipes (``/dev/stdout``) are written directly.

    Raises:
        InputError: If the folder does not exist, or the file cannot be written or is write-protected.
    """
    name = file_name(path)
    try:
        target = Path(os.path.realpath(name))  # a link stays a link: the file it points to is replaced
        if target.is_dir():
            raise IsADirectoryError(None, "this is a folder; give a file name")
        if target.exists() and not target.is_file():
            target.write_bytes(data)
        else:
            _replace(target, data)
    except FileNotFoundError:
        folder = name.parent
        remedy = "no file can be made in it; choose another one" if folder.is_dir() else "does not exist; create it"
        raise InputError(f"{path}: cannot be written: folder '{folder}': {remedy}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be written: {getattr(error, 'strerror', None) or error}") from error


def _replace(target: Path, data: bytes) -> None:
    """Write a file aside, under a name of its own, and let it take the place of another."""
    try:
        mode = stat.S_IMODE(target.stat().st_mode)
    except FileNotFoundError:
        mode = None
    if mode is not None and (not mode & 0o222 or not os.access(target, os.W_OK)):
        raise PermissionError(None, "it is write-protected; choose another name")

    temporary = target.with_name(f".{os.urandom(8).hex()}.tmp")
    try:
        if not _appears_whole(temporary, data):
            with open(temporary, "xb") as file:
                file.write(data)
        if mode is not None:
            temporary.chmod(mode)
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def _appears_whole(file: Path, data: bytes) -> bool:
    """Write a file that has no name before it is whole, so that not even a kill leaves a half; False where none can be.

    Raises:
        OSError: If there is no room for it.
    """
    try:
        folder = os.open(file.parent, os.O_PATH)
    except (AttributeError, OSError):  # Linux has such files, on most of its file systems
        return False
    try:
        number = os.open(".", os.O_TMPFILE | os.O_WRONLY, 0o666, dir_fd=folder)
        with open(number, "wb") as unnamed:
            unnamed.write(data)
            unnamed.flush()
            os.link(f"/proc/self/fd/{number}", file.name, dst_dir_fd=folder, follow_symlinks=True)
    except OSError as error:
        if error.errno in (ENOSPC, EDQUOT, EFBIG):
            raise
        return False
    finally:
        os.close(folder)
    return True


def make_folder(path: str | os.PathLike[str]) -> None:
    """Make a folder and those above it, unless it is there.

    Raises:
        InputError: If it cannot be made.
    """
    try:
        file_name(path).mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: no folder can be made: {getattr(error, 'strerror', None) or error}") from error


def known_ending(path: str | os.PathLike[str], endings: tuple[str, ...], what: str) -> str:
    """Ending of a file in small letters, one of ``endings``; ``what`` says in the error message what the file holds.

    Raises:
        InputError: If it is another one.
    """
    ending = file_name(path).suffix.lower()
    if ending not in endings:
        raise InputError(f"{path}: unknown ending '{ending}' for a {what}; use {', '.join(endings)}")
    return ending


def check_target(path: Path | None, endings: tuple[str, ...]) -> None:
    """Refuse a file that cannot be written before the work is done, not after; None is no file.

    Raises:
        InputError: If the ending is none of ``endings``, or the folder does not exist or cannot be written to.
    """
    if path is None:
        return
    if path.suffix.lower() not in endings:
        raise InputError(f"{path}: unknown ending '{path.suffix}'; use {', '.join(endings)}")

    try:
        folder = path.is_dir()
    except OSError as error:  # the name is too long
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None

    if folder:
        raise InputError(f"{path}: this is a folder; give a file name")
    if not path.parent.is_dir():
        raise InputError(f"{path}: folder '{path.parent}' does not exist; create it")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{path}: folder '{path.parent}' cannot be written to; choose another one")


def file_name(path: object) -> Path:
    """Return the path, if it is text or a path object (a number would be taken for an open file by the system).

    Raises:
        InputError: If it is something else.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"expected the name of a file, got {type(path).__name__} {path!r}")
    return Path(path)


def comma_numbers(text: str, option: str) -> list[float]:
    """Return the numbers of an option of the command line, with commas between them, or one alone.

    Raises:
        InputError: If the text is something else.
    """
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise InputError(f"{option}: expected a number, or numbers with commas between them, got '{text}'") from None


def is_number(text: str) -> bool:
    """Check whether a text reads as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
