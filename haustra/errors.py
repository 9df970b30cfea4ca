"""What can go wrong, one class a cause. Every message says what, where and what to do, in one line."""


class HaustraError(Exception):
    """Base of all errors that haustra raises on purpose. The command line exits with code 2 on it."""


class UnreadableFileError(HaustraError):
    """A file is missing, empty, truncated, of another kind than it says, or not permitted."""


class InvalidMeshError(HaustraError):
    """A surface cannot serve as a colon: open, degenerate, of the wrong scale, or without a lumen."""


class InvalidDesignError(HaustraError):
    """A design value is impossible or outside its stated range."""


class InvalidOptionError(HaustraError):
    """An option of a call has a value that cannot be honoured."""


class InvalidStudyError(HaustraError):
    """A study's file asks for something that is unknown or impossible; the message starts with the key's path."""


class WallAccuracy(HaustraError):
    """A wall could not be built, or its error exceeds what was asked."""


class OutputError(HaustraError):
    """A result cannot be written where it was asked for."""


class UnsupportedSceneError(HaustraError):
    """A backend cannot honour something that the scene contains."""


class MissingDependencyError(HaustraError):
    """An optional package is not installed."""
