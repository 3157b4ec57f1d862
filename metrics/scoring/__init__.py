"""From policies, runs and files of curves to tables of scores, with notes that help to read them."""

from swarm_forage_env.scenarios.performance import Performance

from .limits import ForagingLimit, limit_of
from .plots import draw_scores
from .policy_scores import ScoreQuestion, compare_policies, score_curves, score_policy, score_question
from .question import Question, ask
from .run_curves import StudyLine, study_lines
from .score_tables import Comparison, ScoreTable, compare_tables
from .scores import Score, ScoreForms
from .study_numbers import StudyPanel, StudyPanels, study_panels
from .study_plots import PlottedStudy, StudyFigure, draw_figure, plot, study_figures
from .study_verdict import Judged, StudyVerdict, Waiting, judge_claims, verdict
from .summary import RunQuestion, RunSummary, run_question, summarize_runs

__all__ = [
    "score_policy",
    "compare_policies",
    "score_curves",
    "compare_tables",
    "limit_of",
    "ForagingLimit",
    "ask",
    "run_question",
    "summarize_runs",
    "score_question",
    "study_lines",
    "study_panels",
    "study_figures",
    "draw_figure",
    "judge_claims",
    "verdict",
    "plot",
    "draw_scores",
    "Score",
    "ScoreTable",
    "ScoreForms",
    "Comparison",
    "Question",
    "ScoreQuestion",
    "RunQuestion",
    "StudyLine",
    "StudyPanel",
    "StudyPanels",
    "StudyFigure",
    "StudyVerdict",
    "PlottedStudy",
    "Judged",
    "Waiting",
    "Performance",
    "RunSummary",
]
