"""Break lines of a model: what they were, and what of them every mesh keeps."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from meshsimp_pymoo.arrays import AnyArray, BoolArray, FloatArray, IntArray
from meshsimp_pymoo.plane.constraints import Constraints
from meshsimp_pymoo.reprs import brief


@brief
@dataclass(frozen=True, eq=False)
class ModelLines:
    """Polylines that are chains of edges of every mesh of a model.

    Attributes
    ----------
    originals : tuple of (n, 3) float array
        The lines as they were given, cut where the model ends, soft ones at the surface's heights, in the frame of the
        model's points [model units]. What line errors are measured at.
    chains : tuple of (m,) int array
        The vertices that thinning left of each of them, in order, as rows of the model.
    names : tuple of str
        What messages call each of them; the parts of a line that was cut share its name.
    tolerance : float
        Largest distance in space of a vertex of an original from its thinned line [model units].
    added : (A,) int array
        Rows of the vertices that are none of the model's file, ascending; they have no weight.
    found : dict of str to int
        How many ``lines`` and ``line_vertices`` were given; how many were thinned, added, cut off or left out, as far
        as there are any; for run.json.
    """

    originals: tuple[FloatArray, ...]
    chains: tuple[IntArray, ...]
    names: tuple[str, ...]
    tolerance: float
    added: IntArray
    found: dict[str, int] = field(default_factory=dict)

    @property
    def segments(self) -> IntArray:
        """The forced edges (S, 2) as rows of the model, the lesser first, sorted, each once."""
        ends = np.concatenate([np.column_stack([chain[:-1], chain[1:]]) for chain in self.chains])
        return np.unique(np.sort(ends, axis=1), axis=0)

    @property
    def vertices(self) -> IntArray:
        """The rows of all vertices of the thinned lines, ascending; every mesh keeps them."""
        return np.unique(np.concatenate(self.chains))

    @cached_property
    def shares(self) -> FloatArray:
        """What each vertex of the originals, joined, stands for: half of both pieces beside it, as a share of all."""
        halves = [np.linalg.norm(np.diff(line, axis=0), axis=1) / 2.0 for line in self.originals]
        length = np.concatenate([np.r_[half, 0.0] + np.r_[0.0, half] for half in halves])
        return np.asarray(length / length.sum())

    def errors(self, away: FloatArray) -> dict[str, float]:
        """Return what is said of the lines where each vertex of the originals, joined, is so far from a mesh."""
        return {"line_max_error": float(away.max()), "line_mean_error": float((self.shares * away).sum())}

    def chains_through(self, forced: Constraints, is_site: BoolArray) -> tuple[IntArray, ...]:
        """Return each line as the chain of edges, rows in order, that it is where these vertices (N,) are sites.

        ``forced`` are forced edges, of which those of the lines are the last.
        """
        segments = self.segments
        first = forced.start[len(forced.start) - 1 - len(segments) :]
        between = {}
        for s, (a, b) in enumerate(segments.tolist()):
            on = forced.along[first[s] : first[s + 1]].astype(np.int64)
            between[a, b] = on[is_site[on]]
            between[b, a] = between[a, b][::-1]
        return tuple(
            np.concatenate([chain[:1], *(between[pair][1:] for pair in itertools.pairwise(chain.tolist()))])
            for chain in self.chains
        )

    def with_rows(self, place: IntArray) -> ModelLines:
        """Return the same lines of a model whose vertex i has become vertex ``place[i]``."""
        chains = tuple(place[chain].astype(np.int64) for chain in self.chains)
        return replace(self, chains=chains, added=np.sort(place[self.added]).astype(np.int64))

    @cached_property
    def hash(self) -> str:
        """SHA-256 of all that decides meshes and line errors."""
        digest = hashlib.sha256()
        for name, array in self.arrays().items():
            if name != "names":
                digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    def arrays(self) -> dict[str, AnyArray]:
        """Return the lines as arrays to be stored, one after the other; :meth:`of_arrays` reads them back."""
        return {
            "originals": np.concatenate(self.originals),
            "original_start": _starts(self.originals),
            "chains": np.concatenate(self.chains),
            "chain_start": _starts(self.chains),
            "names": np.array(self.names),
            "tolerance": np.array(self.tolerance),
            "added": self.added,
        }

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, AnyArray]) -> ModelLines:
        """Return the lines that :meth:`arrays` stored, without what was found.

        Raises
        ------
        KeyError
            If an array is missing.
        ValueError
            If they do not fit together.
        """
        originals = _parts(arrays["originals"], arrays["original_start"])
        chains = _parts(arrays["chains"], arrays["chain_start"])
        names = tuple(arrays["names"].tolist())
        if not len(originals) == len(chains) == len(names):
            raise ValueError(f"{len(originals)} lines have {len(chains)} chains and {len(names)} names")
        return cls(originals, chains, names, float(arrays["tolerance"]), arrays["added"])


def _starts(parts: Sequence[AnyArray]) -> IntArray:
    return np.cumsum([0, *map(len, parts)])


def _parts(joined: AnyArray, start: IntArray) -> tuple[AnyArray, ...]:
    if start[0] != 0 or start[-1] != len(joined) or (np.diff(start) < 2).any():
        raise ValueError(f"{len(joined)} vertices are not cut into lines of two or more")
    return tuple(np.split(joined, start[1:-1]))
