"""Reading and writing of files: errors name the file in one line; a file is written completely or not at all."""

from __future__ import annotations

import os
import stat
from difflib import get_close_matches
from errno import EDQUOT, EFBIG, ENOSPC
from pathlib import Path

from rrtik_ompl.base.errors import InputError

MAX_BYTES = 64 * 1024 * 1024  # [bytes] above any problem or path file; stops endless files such as /dev/zero
PAGE_FORMATS = (".html", ".htm")  # endings of 3-D pages
FILM_FORMATS = (".mp4", ".webm", ".gif")
PICTURE_FORMATS = (".png",)


def read_text(path: str | os.PathLike[str], limit: int = MAX_BYTES) -> str:
    """Read a UTF-8 text file of at most ``limit`` bytes.

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
    """Read a file of at most ``limit`` bytes.

    Raises:
        InputError: If the file is missing, a folder, unreadable or too large.
    """
    file_name(path)
    try:
        with open(path, "rb") as file:
            length = os.fstat(file.fileno()).st_size  # 0 for devices and pipes
            # Python takes memory for as much as is asked for, before it reads.
            data = file.read((length or limit) + 1) if length <= limit else b""
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
    """Return a hint that names a similarly named file in the same folder."""
    try:
        near = get_close_matches(path.name, os.listdir(path.parent), n=1, cutoff=0.8)
    except (OSError, ValueError):
        return f"; folder '{path.parent}' does not exist"
    return f"; did you mean '{near[0]}'?" if near else "; check the name"


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a UTF-8 text file completely or not at all, see :func:`write_bytes`.

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
    """Write a file so that an interruption leaves either the old file or the new one, never a part.

    The data are written to a temporary file in the same folder, which then replaces the old file and takes over its
    mode. Devices and pipes (``/dev/stdout``) are written directly.

    Raises:
        InputError: If the folder does not exist, or the file cannot be written or is write-protected.
    """
    name = file_name(path)
    try:
        target = Path(os.path.realpath(name))  # a link is kept, and the file that it points to replaced
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
    """Write a temporary file and let it replace the target, whose mode it takes over."""
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
    """Write a file without a name and name it when it is complete, so that even a killed process leaves no part of it.

    The result is False if the system does not support this.

    Raises:
        OSError: If there is no space for it.
    """
    try:
        folder = os.open(file.parent, os.O_PATH)
    except (AttributeError, OSError):  # only Linux supports such files, on most file systems
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
    """Create a folder and all missing ones above it.

    Raises:
        InputError: If it cannot be created.
    """
    try:
        file_name(path).mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: no folder can be made: {getattr(error, 'strerror', None) or error}") from error


def known_ending(path: str | os.PathLike[str], endings: tuple[str, ...], what: str) -> str:
    """Return the ending of a file in lower case, one of ``endings``; ``what`` names its content in the message.

    Raises:
        InputError: If it has another ending.
    """
    ending = file_name(path).suffix.lower()
    if ending not in endings:
        raise InputError(f"{path}: unknown ending '{ending}' for a {what}; use {', '.join(endings)}")
    return ending


def check_target(path: Path | None, endings: tuple[str, ...]) -> None:
    """Refuse a file that could not be written later, before the work is done; None stands for no file.

    Raises:
        InputError: If the ending is not in ``endings``, or the folder does not exist or is not writable.
    """
    if path is None:
        return
    if path.suffix.lower() not in endings:
        raise InputError(f"{path}: unknown ending '{path.suffix}'; use {', '.join(endings)}")

    try:
        folder = path.is_dir()
    except OSError as error:  # raised if the name is too long
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None

    if folder:
        raise InputError(f"{path}: this is a folder; give a file name")
    if not path.parent.is_dir():
        raise InputError(f"{path}: folder '{path.parent}' does not exist; create it")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{path}: folder '{path.parent}' cannot be written to; choose another one")


def file_name(path: object) -> Path:
    """Return a path given as text or path object as a Path. Numbers are refused, as they would denote open files.

    Raises:
        InputError: If it is something else.
    """
    if not isinstance(path, (str, os.PathLike)) or not isinstance(os.fspath(path), str):  # which may be bytes
        raise InputError(f"expected the name of a file, got {type(path).__name__} {path!r}")
    return Path(path)


def is_utf8(name: str) -> bool:
    """Check whether a name can be written as UTF-8; in names of files that are not, Python marks the other bytes."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def comma_numbers(text: str, option: str) -> list[float]:
    """Parse the value of a command-line option: one number, or several separated by commas.

    Raises:
        InputError: If the text is something else.
    """
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise InputError(f"{option}: expected a number, or numbers with commas between them, got '{text}'") from None


def is_number(text: str) -> bool:
    """Check whether a text can be parsed as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
