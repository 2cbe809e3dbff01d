"""Making a flat model: which models can be one, and what their workspace holds."""

from __future__ import annotations

from flexctrl.model.flat.flattened import Flattened
from flexctrl.model.flat.layout import Layout
from flexctrl.model.flat.small_layout import SmallLayout
from flexctrl.model.model import Model

__all__ = ["Flattened", "can_be_flat", "flatten", "layout_of"]


def can_be_flat(model: Model) -> bool:
    """Tell whether `flatten` covers a model.

    In small motion no loads that turn with their nodes.
    """
    return model.n > 0 and (model.large or not model.signals.follows)


def flatten(model: Model) -> Flattened:
    """Return a model on flat vectors of its own; what does not change is worked out once a model.

    Parameters
    ----------
    model : Model
        One that `can_be_flat`.

    Returns
    -------
    Flattened
    """
    return layout_of(model).made()


def layout_of(model: Model) -> Layout:
    """Return where everything stands in the workspace of a model that `can_be_flat`."""
    layout = model.__dict__.get("_layout")
    if layout is None:
        layout = model.__dict__["_layout"] = (Layout if model.large else SmallLayout)(model)
    return layout
