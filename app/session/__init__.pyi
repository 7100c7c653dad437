from .candidate_residuals import CandidateResidual, by_evidence
from .channel_guess import ChannelKind, ChannelSummary, is_swapped, proposed_roles, summarise_channels
from .entry import Entry
from .jobs import Event, EventKind, Job, Jobs, Saver, ShotJob
from .kernels import Kernels, Stage, complete, prepare, prepare_first_shot, warm_up_analysis
from .load import analysed, cause_of, load_and_analyse, raw_of, unanalysed
from .log import NAME, ProgramLog, note
from .model_in_use import OwnLaws, drift_words, load_model, predicted, significant_drift, write_model
from .next_shots import PLAN, NextShots, planned_record, planned_setup
from .result_cache import ResultCache
from .rig import Open, Rig
from .session import Session
from .session_files import is_session, last_session
from .settings import FIELDS
from .settings_store import SettingsStore
from .spectra import BEATS, Spectra, spectra_of
from .spool import Spool
from .verdict_basis import Diagnosed, verdict_of
from .workbench import Workbench

__all__ = [
    "BEATS",
    "FIELDS",
    "NAME",
    "PLAN",
    "CandidateResidual",
    "ChannelKind",
    "ChannelSummary",
    "Diagnosed",
    "Entry",
    "Event",
    "EventKind",
    "Job",
    "Jobs",
    "Kernels",
    "NextShots",
    "Open",
    "OwnLaws",
    "ProgramLog",
    "ResultCache",
    "Rig",
    "Saver",
    "Session",
    "SettingsStore",
    "ShotJob",
    "Spectra",
    "Spool",
    "Stage",
    "Workbench",
    "analysed",
    "by_evidence",
    "cause_of",
    "complete",
    "drift_words",
    "is_session",
    "is_swapped",
    "last_session",
    "load_and_analyse",
    "load_model",
    "note",
    "planned_record",
    "planned_setup",
    "predicted",
    "prepare",
    "prepare_first_shot",
    "proposed_roles",
    "raw_of",
    "significant_drift",
    "spectra_of",
    "summarise_channels",
    "unanalysed",
    "verdict_of",
    "warm_up_analysis",
    "write_model",
]
