# made by docs/programs/reference.py
from cosim.errors import BadInput as BadInput
from cosim.errors import SimulationFailed as SimulationFailed
from cosim.scene import load as load
from cosim.simulation.simulate import run as run
from cosim.studies.accuracy.accuracy import accuracy as accuracy
from cosim.studies.compare.run import compare as compare
from cosim.studies.fit.fit import fit as fit
from cosim.studies.identify.run import identify as identify
from cosim.studies.limits.report import limits as limits
from cosim.studies.measure.measure import measure as measure
from cosim.studies.paper.theory import theory as theory
from cosim.studies.speed.bench import bench as bench
from cosim.studies.speed.ladder import ladder as ladder
from cosim.studies.stability.stability import stability as stability
from cosim.studies.sweep.run import sweep as sweep
from cosim.studies.tune.run import tune as tune
from cosim.studies.tune.spread import spread as spread
from cosim.version import __version__ as __version__
from cosim.waveforms.result import Result as Result

def homes() -> dict[str, str]: ...
