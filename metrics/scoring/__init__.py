"""From policies, runs and files of curves to tables of scores, with notes that help to read them."""

from swarm_forage_env.scenarios.performance import Performance

from .ablation import Ablation, AblationQuestion, ablate_quirks, ablation_question
from .choosing import Choice, ChoiceQuestion, choice_question, choose_policy
from .from_scenario import (
    ScenarioPrediction,
    ScenarioPredictions,
    ScenarioQuestion,
    predict_from_scenario,
    scenario_question,
)
from .outlook import Outlook, what_would_decide
from .plots import draw_predictions, draw_scores
from .policy_scores import ScoreQuestion, compare_policies, score_curves, score_policy, score_question
from .prediction import (
    PredictionQuestion,
    Predictions,
    PredictionTable,
    predict_curves,
    predict_policy,
    prediction_question,
)
from .question import Question, ask
from .run_curves import StudyLine, study_lines
from .score_tables import Comparison, ScoreTable, compare_tables
from .scores import Score, ScoreForms
from .study_diff import StudyDiff, diff
from .study_numbers import StudyPanel, StudyPanels, study_panels
from .study_plots import PlottedStudy, StudyFigure, draw_figure, draw_map, plot, study_figures
from .study_report import StudyReport, report
from .study_verdict import Judged, StudyVerdict, Waiting, judge_claims, verdict
from .summary import RunQuestion, RunSummary, run_question, summarize_runs
from .until_decided import run_until_decided
from .world_limits import limit_of

__all__ = [
    "score_policy",
    "compare_policies",
    "score_curves",
    "compare_tables",
    "limit_of",
    "ask",
    "run_question",
    "summarize_runs",
    "score_question",
    "prediction_question",
    "predict_from_scenario",
    "scenario_question",
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
    "what_would_decide",
    "run_until_decided",
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
    "ScenarioQuestion",
    "ScenarioPrediction",
    "ScenarioPredictions",
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
    "Outlook",
    "Judged",
    "Waiting",
    "Performance",
    "PredictionTable",
    "Predictions",
    "Choice",
    "RunSummary",
    "Ablation",
]
