"""Arrays as the package's signatures name them."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
