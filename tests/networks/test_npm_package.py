"""Files out of npm packages: the right ones, or none."""

import hashlib
import io
import subprocess
import tarfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from mcap_landmarks.errors import ModelError, UsageError
from mcap_landmarks.networks import npm_package
from mcap_landmarks.networks.npm_package import NpmPackage, package_files

CONTENT = b"weights"
PACKAGE = NpmPackage("@a/b", "1.0.0", {"package/w.bin": hashlib.sha256(CONTENT).hexdigest()})


def entry(name: str, size: int = len(CONTENT), kind: bytes = tarfile.REGTYPE, link: str = "") -> tarfile.TarInfo:
    made = tarfile.TarInfo(name)
    made.size, made.type, made.linkname = size, kind, link
    return made


def archive(path: Path, entries: Sequence[tuple[tarfile.TarInfo, bytes]]) -> Path:
    with tarfile.open(path, "w:gz") as content:
        for info, data in entries:
            content.addfile(info, io.BytesIO(data))
    return path


def ignore(_advance: int) -> None:
    """No progress."""


def test_a_file_of_the_package_is_read(tmp_path: Path) -> None:
    others = (entry("package/other", 3), b"abc"), (entry("../../escape", 3), b"abc")
    path = archive(tmp_path / "a.tgz", [*others, (entry("package/w.bin"), CONTENT)])
    assert package_files(PACKAGE, path, ignore) == {"package/w.bin": CONTENT}
    assert sorted(tmp_path.parent.glob("escape")) == []
    assert [file.name for file in tmp_path.iterdir()] == ["a.tgz"]  # nothing is unpacked


def test_what_is_not_the_package_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = "package/w.bin"
    damaged = archive(tmp_path / "damaged.tgz", [(entry(wanted), CONTENT)])
    damaged.write_bytes(damaged.read_bytes()[:40])
    (tmp_path / "no.tgz").write_bytes(b"no archive")
    link, device = entry(wanted, 0, tarfile.SYMTYPE, "/etc/passwd"), entry(wanted, 0, tarfile.CHRTYPE)
    made = {
        "is missing": archive(tmp_path / "empty.tgz", []),
        "has the SHA-256 ": archive(tmp_path / "other.tgz", [(entry(wanted), b"weighty")]),
        "package/w.bin is no file of at most": archive(tmp_path / "link.tgz", [(link, b"")]),
        "package/w.bin is no file": archive(tmp_path / "device.tgz", [(device, b"")]),
        "not an npm package (.tgz) that can be read": damaged,
        "not an npm package": tmp_path / "no.tgz",
        "nowhere.tgz": tmp_path / "nowhere.tgz",
    }
    for said, path in made.items():
        with pytest.raises(ModelError) as error:
            package_files(PACKAGE, path, ignore)
        assert said in str(error.value)
    whole = archive(tmp_path / "whole.tgz", [(entry(wanted), CONTENT)])
    monkeypatch.setattr(npm_package, "_MOST_BYTES", len(CONTENT) - 1)
    with pytest.raises(ModelError, match=r"no file of at most 6 bytes"):
        package_files(PACKAGE, whole, ignore)
    monkeypatch.setattr(npm_package, "_MOST_UNPACKED", 100)
    with pytest.raises(ModelError, match="it unpacks to more than 100 bytes"):
        package_files(PACKAGE, whole, ignore)


def test_npm_packs_the_version_that_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Sequence[str]] = []

    def pack(command: Sequence[str], cwd: Path, **_: object) -> "subprocess.CompletedProcess[str]":
        asked.append(command)
        archive(cwd / "a-b-1.0.0.tgz", [(entry("package/w.bin"), CONTENT)])
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(npm_package.shutil, "which", lambda _: "/bin/npm")
    monkeypatch.setattr(npm_package.subprocess, "run", pack)
    assert package_files(PACKAGE, None, ignore) == {"package/w.bin": CONTENT}
    assert asked == [["/bin/npm", "pack", "@a/b@1.0.0", "--ignore-scripts", "--loglevel=error", "--fetch-retries=1"]]


def test_without_npm_or_network_the_other_way_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(command: Sequence[str], **_: object) -> "subprocess.CompletedProcess[str]":
        return subprocess.CompletedProcess(command, 1, "", "\nnpm error code ENOTFOUND\nnpm error more\n")

    monkeypatch.setattr(npm_package.shutil, "which", lambda _: "/bin/npm")
    monkeypatch.setattr(npm_package.subprocess, "run", fails)
    with pytest.raises(ModelError, match=r"failed \(npm error code ENOTFOUND\); download .* --from FILE.tgz"):
        package_files(PACKAGE, None, ignore)
    monkeypatch.setattr(npm_package.shutil, "which", lambda _: None)
    with pytest.raises(UsageError, match=r"npm, which fetches @a/b@1.0.0, is not installed: .* --from FILE.tgz"):
        package_files(PACKAGE, None, ignore)
