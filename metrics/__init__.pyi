# Public names, each written once, those first that are needed first; `__init__.py` loads them when they are first used.

# what runs were
from .scoring import summarize_runs as summarize_runs
from .scoring import RunSummary as RunSummary

# from policies and files of curves to tables of scores
from .scoring import score as score
from .scoring import read_curves as read_curves
from .scoring import Scores as Scores

# what studies say
from .scoring import verdict as verdict
from .scoring import plot as plot
from .scoring import StudyVerdict as StudyVerdict

# interference
from .interference import t_lost_fraction as t_lost_fraction
from .interference import performance_lost as performance_lost
from .interference import fractional_loss as fractional_loss

# emergence
from .emergence import spatial_emergence as spatial_emergence
from .emergence import time_emergence as time_emergence
from .emergence import task_emergence as task_emergence
from .emergence import interference_gain as interference_gain
from .emergence import undisturbed_gain as undisturbed_gain

# scalability
from .scaling import scalability as scalability
from .scaling import efficiency as efficiency
from .scaling import raw_performance as raw_performance

# distance
from .distance import dtw as dtw
from .distance import aligned_l1 as aligned_l1
from .distance import noise_floor as noise_floor

# environment
from .environment import waveform as waveform
from .environment import environment_scaling as environment_scaling
from .environment import environment_distance as environment_distance

# flexibility and robustness to noise
from .flexibility import reactivity as reactivity
from .flexibility import adaptability as adaptability
from .flexibility import noise_robustness as noise_robustness
from .flexibility import mean_signed_difference as mean_signed_difference

# queues and population
from .queues import PopulationRates as PopulationRates
from .checks import PopulationError as PopulationError
from .queues import QueueStats as QueueStats
from .queues import queue_statistics as queue_statistics
from .queues import mean_away as mean_away
from .population import population_robustness as population_robustness
from .population import recorded_population_robustness as recorded_population_robustness
from .population import population_weight as population_weight
from .population import availability as availability
from .population import ratio_for_team as ratio_for_team

# the law of swarm sizes
from .size_law import fit_law as fit_law
from .size_law import SizeLaw as SizeLaw

# how near to the limit
from .scoring import limit_of as limit_of
from .scoring import ForagingLimit as ForagingLimit

# statistics
from .statistics import normalize as normalize
from .statistics import Summary as Summary
from .statistics import aggregate as aggregate
from .statistics import Estimate as Estimate
from .statistics import interquartile_mean as interquartile_mean
from .statistics import probability_of_improvement as probability_of_improvement
from .statistics import paired_tests as paired_tests

# claims of the paper
from .controllers import PAPER_POLICIES as PAPER_POLICIES
from .claims import CLAIMS as CLAIMS
from .claims import check_claims as check_claims
from .claims import Claim as Claim
from .claims import Panel as Panel
from .claims import Verdict as Verdict

# overview and errors
from .scoring import MEASURES as MEASURES
from .scoring import Measure as Measure
from .checks import CurveError as CurveError
