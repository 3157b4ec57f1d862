"""From policies, runs and files of curves to tables of scores, with notes that help to read them."""

from swarm_forage_env.scenarios.performance import Performance

from .ablation import Ablation, AblationQuestion, ablate_quirks, ablation_question
from .choosing import Choice, ChoiceQuestion, choice_question, choose_policy
from .comparison import Comparison, compare_tables
from .figure_panels import StudyPanel, StudyPanels, study_panels
from .front_door import ScoreQuestion, compare_policies, score_curves, score_policy, score_question
from .measures import ScoreForms
from .plots import draw_scores
from .prediction import (
    PredictionQuestion,
    Predictions,
    PredictionTable,
    predict_curves,
    predict_policy,
    prediction_question,
)
from .prediction_plots import draw_predictions
from .question import Question, ask
from .study_diff import StudyDiff, diff
from .study_pictures import PlottedStudy, plot
from .study_plots import StudyFigure, draw_figure, draw_map, study_figures
from .study_report import StudyReport, report
from .study_tables import StudyLine, study_lines
from .study_verdict import StudyVerdict, verdict
from .summary import RunQuestion, RunSummary, run_question, summarize_runs
from .table import Score, ScoreTable
from .verdicts import Judged, Waiting, judge_claims

__all__ = [
    "score_policy",
    "compare_policies",
    "score_curves",
    "compare_tables",
    "ask",
    "run_question",
    "summarize_runs",
    "score_question",
    "prediction_question",
    "choice_question",
    "ablate_quirks",
    "ablation_question",
    "study_lines",
    "study_panels",
    "study_figures",
    "draw_figure",
    "draw_map",
    "judge_claims",
    "verdict",
    "diff",
    "plot",
    "report",
    "draw_scores",
    "predict_policy",
    "predict_curves",
    "draw_predictions",
    "choose_policy",
    "Score",
    "ScoreTable",
    "ScoreForms",
    "Comparison",
    "Question",
    "ScoreQuestion",
    "PredictionQuestion",
    "ChoiceQuestion",
    "RunQuestion",
    "AblationQuestion",
    "StudyLine",
    "StudyPanel",
    "StudyPanels",
    "StudyFigure",
    "StudyVerdict",
    "StudyDiff",
    "PlottedStudy",
    "StudyReport",
    "Judged",
    "Waiting",
    "Performance",
    "PredictionTable",
    "Predictions",
    "Choice",
    "RunSummary",
    "Ablation",
]
