"""From policies, runs and files of curves to tables of scores, with notes that help to read them."""

from .answer import Scores
from .curves_file import read_curves
from .frame import differences, scores, summarized
from .limits import ForagingLimit, limit_of
from .measures import MEASURES, Measure
from .plots import draw_scores
from .policy_scores import Question, score, score_question
from .run_curves import StudyLine, study_lines
from .study_numbers import StudyPanel, study_panels
from .study_plots import StudyFigure, draw_figure, plot, study_figures
from .study_verdict import StudyVerdict, verdict
from .summary import RunSummary, summarize_runs

__all__ = [
    "MEASURES",
    "Measure",
    "score",
    "read_curves",
    "scores",
    "summarized",
    "differences",
    "limit_of",
    "ForagingLimit",
    "summarize_runs",
    "score_question",
    "study_lines",
    "study_panels",
    "study_figures",
    "draw_figure",
    "verdict",
    "plot",
    "draw_scores",
    "Scores",
    "Question",
    "StudyLine",
    "StudyPanel",
    "StudyFigure",
    "StudyVerdict",
    "RunSummary",
]
