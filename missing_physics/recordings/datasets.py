"""Public real recordings: where they are, by commit and checksum, and how to get them."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote

import pooch

from robot_model import InputError, nearest

__all__ = ["DATASETS", "DATA_VARIABLE", "DataFile", "Dataset", "fetch_dataset", "local_folder"]

#: Environment variable that names a folder with datasets, `FOLDER/NAME/FILE`, which is looked into first.
DATA_VARIABLE = "MISSING_PHYSICS_DATA"
#: Overrides pooch's own choice of the user's cache folder.
CACHE_VARIABLE = "MISSING_PHYSICS_CACHE"

_HOST = "https://raw.githubusercontent.com"


@dataclass(frozen=True)
class DataFile:
    """One file: its name here, its path in the public repository, and its SHA-256."""

    name: str
    path: str
    sha256: str


@dataclass(frozen=True)
class Dataset:
    """A public recording of a real machine, pinned to a commit."""

    name: str
    what: str
    repository: str
    commit: str
    licence: str
    files: tuple[DataFile, ...]

    def url(self, file: DataFile) -> str:
        """Where the file is downloaded from."""
        return f"{_HOST}/{self.repository}/{self.commit}/{quote(file.path)}"


def fetch_dataset(name: str, *, downloader: Callable[..., Any] | None = None, progress: bool = False) -> Path:
    """The folder with all files of a dataset; what is missing is downloaded into the user's cache.

    Args:
        name: a key of `DATASETS`.
        downloader: called as ``downloader(url, output_file, pooch)`` instead of an HTTP download.
        progress: show a progress bar on stderr.

    Raises:
        InputError: unknown name, wrong checksum, no network.
    """
    dataset = _known(name)
    local = local_folder(name)
    if local is not None:
        return local
    folder = Path(os.environ.get(CACHE_VARIABLE) or pooch.os_cache("missing-physics")) / name
    for file in dataset.files:
        _download(dataset, file, folder, downloader=downloader, progress=progress)
    return folder


def local_folder(name: str) -> Path | None:
    """The dataset's folder under `MISSING_PHYSICS_DATA`, with every checksum verified; None if not whole.

    Raises:
        InputError: unknown name, or a file there that is not the published one.
    """
    dataset = _known(name)
    root = os.environ.get(DATA_VARIABLE)
    if not root:
        return None
    folder = Path(root) / name
    if not all((folder / file.name).is_file() for file in dataset.files):
        return None
    for file in dataset.files:
        if _sha256(folder / file.name) != file.sha256:
            raise InputError(
                f"{folder / file.name} is not the published file (its SHA-256 differs); replace it, or unset "
                f"{DATA_VARIABLE} to download it."
            )
    return folder


def _known(name: str) -> Dataset:
    if name not in DATASETS:
        known = ", ".join(DATASETS)
        raise InputError(f"there is no dataset '{name}'{nearest(name, DATASETS) or f'; there are {known}.'}")
    return DATASETS[name]


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _download(
    dataset: Dataset,
    file: DataFile,
    folder: Path,
    *,
    downloader: Callable[..., Any] | None,
    progress: bool,
) -> None:
    """Into `folder`; pooch verifies the checksum before the file takes its name."""
    try:
        pooch.retrieve(
            dataset.url(file),
            known_hash=f"sha256:{file.sha256}",
            fname=file.name,
            path=folder,
            downloader=downloader,
            progressbar=progress and downloader is None,
        )
    except ValueError:
        raise InputError(
            f"{dataset.url(file)} did not give the published file (its SHA-256 differs); try again later."
        ) from None
    except OSError as error:  # requests' own errors derive from OSError too
        reason = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise InputError(
            f"{dataset.url(file)} cannot be downloaded ({reason}); check the network, or put the file into "
            f"FOLDER/{dataset.name}/{file.name} and set {DATA_VARIABLE}=FOLDER."
        ) from None


_ALL = (
    Dataset(
        name="emps",
        what="one prismatic axis with a ball screw (EMPS benchmark), 2 x 24.8 s at 1 kHz",
        repository="wmkouw/NSI-EMPS",
        commit="d1137b8cc8a5ec3d75fe69c5d531075f7f6f616a",
        licence="MIT",
        files=(
            DataFile(
                "DATA_EMPS.mat",
                "data/DATA_EMPS.mat",
                "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
            ),
            DataFile(
                "DATA_EMPS_PULSES.mat",
                "data/DATA_EMPS_PULSES.mat",
                "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704",
            ),
        ),
    ),
    Dataset(
        name="quanser_two_link",
        what="two leaf-spring links on two geared motors, 2 x 20 s at 500 Hz",
        repository="basta/quanser-2-dof-serial-flexible-link",
        commit="48ab0ce6a1b3038e971dec828005c72e90a12e5a",
        licence="MIT",
        files=(
            DataFile(
                "lqr_full_10deg.mat",
                "software/quanser_updated/lqr_full_10deg.mat",
                "07d75adb0c3e938f9a91653df214acc9e34575f8c1992e8b08249761f6d2ec26",
            ),
            DataFile(
                "quarc_data_fsf_Im1.mat",
                "software/quanser_updated/Results/data_fsf_Im1.mat",
                "2571c01177a84beb218fb9a3690f7df4c9ce0488a37cc6d0ec92b306e4fe9638",
            ),
            DataFile(
                "quarc_data_fsf_Im2.mat",
                "software/quanser_updated/Results/data_fsf_Im2.mat",
                "0fed65953f6b0714c914a812c47e8f9a0fe1ff5f39df9103aaf01476f40c36b0",
            ),
            DataFile(
                "quarc_data_fsf_th11.mat",
                "software/quanser_updated/Results/data_fsf_th11.mat",
                "deb81153d67653884e208e6c33867118e709df8da1160e007a5ee755fbd6cd92",
            ),
            DataFile(
                "quarc_data_fsf_th12.mat",
                "software/quanser_updated/Results/data_fsf_th12.mat",
                "efcaeeb2d0816cf920c8be6ee582f3f3d3a793d118e81e98962ed9d54bf0a073",
            ),
            DataFile(
                "quarc_data_fsf_th21.mat",
                "software/quanser_updated/Results/data_fsf_th21.mat",
                "c1313c875b415090e0fb423a5864655c58398cbc96718399425f69d9918a02e7",
            ),
            DataFile(
                "quarc_data_fsf_th22.mat",
                "software/quanser_updated/Results/data_fsf_th22.mat",
                "3b59520e7aea5c54a76cb4a48276ef94075360f9b304687b73f7084659bdac36",
            ),
        ),
    ),
    Dataset(
        name="kuka_kr300",
        what="industrial robot of six axes with secondary encoders, 2 x 10 s at 250 Hz",
        repository="JonasWeigand/Robot_Identification",
        commit="9e403c07d9dadbb391a9f3921e8d219f714636a8",
        licence="MIT",
        files=(
            DataFile(
                "traj_A.mat",
                "data/recorded_trajectories/2020-10-21 10s FF A 08ms/data.mat",
                "4c152c5b7f2c899731fdeebcf0d011cc103df72be19fac160caf47aa9b73ab75",
            ),
            DataFile(
                "traj_B.mat",
                "data/recorded_trajectories/2020-10-21 10s FF B 08ms/data.mat",
                "edeb35f65c4ec4bb697e757fc1e4e9668551b6fe7b2c3dbbb526d040dd8d5ce7",
            ),
        ),
    ),
    Dataset(
        name="servo_pendulum",
        what="hobby servo turning a pendulum, 12 x 6 s at about 190 Hz",
        repository="Rhoban/bam",
        commit="af2260462471ff45ac18af159b1327ea51d8db15",
        licence="Apache-2.0",
        files=(
            DataFile(
                "xl330_2026-01-15_10h28m10.json",
                "bam/data.bak/raw/2026-01-15_10h28m10.json",
                "e58f3c2a08a5e0e37a2c5e930d0830a438bc102b8d21482767124f495b92f2ce",
            ),
            DataFile(
                "xl330_2026-01-15_10h28m17.json",
                "bam/data.bak/raw/2026-01-15_10h28m17.json",
                "ef6507934ba465eb31529d7d98715ecc70bd5c87be049fd4618a94ce39290569",
            ),
            DataFile(
                "xl330_2026-01-15_10h28m24.json",
                "bam/data.bak/raw/2026-01-15_10h28m24.json",
                "165b171df12b3e8b39504ce36d37e373ad105c0dddf4d3d073c747fd492e8bef",
            ),
            DataFile(
                "xl330_2026-01-15_10h28m32.json",
                "bam/data.bak/raw/2026-01-15_10h28m32.json",
                "fdc255edae6995298af437f37582eb8cd0c4a5ddcec4f49fb7c4d6f3303aaa9c",
            ),
            DataFile(
                "xl330_2026-01-15_10h28m42.json",
                "bam/data.bak/raw/2026-01-15_10h28m42.json",
                "1c6386bfa3be021c8ca8a96a7cbee93914f6271a050282b1c3b7d5ef373427db",
            ),
            DataFile(
                "xl330_2026-01-15_10h28m49.json",
                "bam/data.bak/raw/2026-01-15_10h28m49.json",
                "e2223826274fca7799a2be0cb371e4269ead88cd9077fbb68498ef93e4e0de97",
            ),
            DataFile(
                "xl330_2026-01-15_10h28m57.json",
                "bam/data.bak/raw/2026-01-15_10h28m57.json",
                "c10a350d9c7222d4d3499d140edd3ac4e63fe94f3b59a675116a34db7d66152c",
            ),
            DataFile(
                "xl330_2026-01-15_10h29m04.json",
                "bam/data.bak/raw/2026-01-15_10h29m04.json",
                "7996c43314a9f60094a6119346b54ff9ff84cb6726c967f4a88a7175278f6515",
            ),
            DataFile(
                "xl330_2026-01-15_10h29m14.json",
                "bam/data.bak/raw/2026-01-15_10h29m14.json",
                "016d15d21c464457aa30eaeab3977228b08cd5acf7542f24067440126c0bf480",
            ),
            DataFile(
                "xl330_2026-01-15_10h29m21.json",
                "bam/data.bak/raw/2026-01-15_10h29m21.json",
                "fe68cff62e976c87a2fcab925a517fbff83be16c862693310fdc1eff743eddab",
            ),
            DataFile(
                "xl330_2026-01-15_10h29m29.json",
                "bam/data.bak/raw/2026-01-15_10h29m29.json",
                "b9ce9fc0f396e6b03bd514e9254cb83b8a64e1a5df1728b9a10e3b4a5a9513ca",
            ),
            DataFile(
                "xl330_2026-01-15_10h29m37.json",
                "bam/data.bak/raw/2026-01-15_10h29m37.json",
                "838d390b7190c4ce1608157cf629989648773b7336728a0931a61c6018c6700b",
            ),
        ),
    ),
)

#: Name to dataset.
DATASETS: Mapping[str, Dataset] = MappingProxyType({dataset.name: dataset for dataset in _ALL})
