from .atomic_file import (
    check_writable,
    copy_permissions,
    replace_file,
    sync_folder,
    write_atomic,
    write_json_atomic,
    write_text_atomic,
)
from .checked import Checked
from .folder_lock import FolderLock, FolderLocked, disk_free_bytes
from .foreign.contents import ForeignChannel, ForeignColumn, ForeignContents
from .foreign.mapping import (
    FOLDER_MAPPING,
    FORMATS,
    ForeignMapping,
    MappedChannel,
    find_mapping,
    format_of,
    is_foreign,
    mapping_path,
    read_mapping,
    write_mapping,
)
from .foreign.reading import foreign_channels, foreign_columns, read_foreign
from .law_file import read_law, read_laws, write_law
from .motion_columns import LENGTHS_M, MODELS, TABLE, MotionColumns, length_unit
from .motion_file import MotionRecord, read_motion, save_columns
from .raw_recording import analyse_and_check_hash, open_recording, open_without_hash
from .recording_error import FileNotReached, PartlySaved, RecordingError, RecordingExists, one_line, shown
from .recording_file import ENDED_EARLY, data_hash, read_recording
from .recording_metadata import read_metadata
from .recording_search import find_recordings, is_motion_record, recording_stem
from .recording_writer import RecordingWriter, rewrite_note, write_recording
from .text_file import open_regular, read_json, read_toml_text

__all__ = [
    "ENDED_EARLY",
    "FOLDER_MAPPING",
    "FORMATS",
    "LENGTHS_M",
    "MODELS",
    "TABLE",
    "Checked",
    "FileNotReached",
    "FolderLock",
    "FolderLocked",
    "ForeignChannel",
    "ForeignColumn",
    "ForeignContents",
    "ForeignMapping",
    "MappedChannel",
    "MotionColumns",
    "MotionRecord",
    "PartlySaved",
    "RecordingError",
    "RecordingExists",
    "RecordingWriter",
    "analyse_and_check_hash",
    "check_writable",
    "copy_permissions",
    "data_hash",
    "disk_free_bytes",
    "find_mapping",
    "find_recordings",
    "foreign_channels",
    "foreign_columns",
    "format_of",
    "is_foreign",
    "is_motion_record",
    "length_unit",
    "mapping_path",
    "one_line",
    "open_recording",
    "open_regular",
    "open_without_hash",
    "read_foreign",
    "read_json",
    "read_law",
    "read_laws",
    "read_mapping",
    "read_metadata",
    "read_motion",
    "read_recording",
    "read_toml_text",
    "recording_stem",
    "replace_file",
    "rewrite_note",
    "save_columns",
    "shown",
    "sync_folder",
    "write_atomic",
    "write_json_atomic",
    "write_law",
    "write_mapping",
    "write_recording",
    "write_text_atomic",
]
