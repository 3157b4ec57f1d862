"""Transitions of a data set for torch: `DataLoader(TransitionData(folder), batch_size=256, shuffle=True)`."""

from pathlib import Path

import torch
from torch.utils.data import Dataset

from swarm_forage_env.training.datasets.reading import TrajectoryDataset


class TransitionData(Dataset[dict[str, torch.Tensor]]):
    """Decisions of robots that were at work, as dictionaries of tensors; all of them in memory.

    An item has `observations` (d,) and `next_observations` (d,) float32, `actions` (int64, or (k,) float32), `rewards`
    (float32), `terminated` and `truncated` (bool).
    """

    def __init__(self, folder: str | Path) -> None:
        """Read a folder; raises DatasetError where it holds no whole run."""
        rows = TrajectoryDataset(folder).transitions()
        self.tensors = {
            "observations": torch.from_numpy(rows.observations),
            "actions": torch.from_numpy(rows.actions),
            "rewards": torch.from_numpy(rows.rewards).to(torch.float32),
            "next_observations": torch.from_numpy(rows.next_observations),
            "terminated": torch.from_numpy(rows.terminated),
            "truncated": torch.from_numpy(rows.truncated),
        }

    def __len__(self) -> int:
        return len(self.tensors["rewards"])

    def __getitem__(self, index: int) -> dict[str, torch.Tensor]:
        """Return one decision of one robot."""
        return {name: values[index] for name, values in self.tensors.items()}
