"""The check of annotations while testing: array shapes, and plain types as type checkers and numpy have them."""

import numpy as np
from beartype import BeartypeConf, FrozenDict, beartype
from pydantic import ValidationInfo

checked = beartype(
    conf=BeartypeConf(
        is_pep484_tower=True,  # an int is a float
        hint_overrides=FrozenDict(
            {
                int: int | np.integer,  # numbers taken out of arrays
                bool: bool | np.bool_,
                ValidationInfo: object,  # a protocol that isinstance cannot check
            }
        ),
    )
)
