"""`haustra completion`: what shells complete after `haustra` and a tab."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import tyro

from haustra.scripts.registry import VERBS, first_sentence, load_verb


@dataclass(frozen=True)
class Completion:
    """Print a script that lets a shell complete verbs, options and choices.

    For bash: `haustra completion bash > ~/.local/share/bash-completion/completions/haustra`. For zsh, after compinit:
    `source <(haustra completion zsh)`. For fish: `haustra completion fish > ~/.config/fish/completions/haustra.fish`.
    """

    shell: Annotated[Literal["bash", "zsh", "fish"], tyro.conf.Positional]
    """Shell that the script is for."""
    json: bool = field(default=False)
    """Print one JSON document, which holds the script, instead of the script alone."""

    def __call__(self) -> dict[str, Any] | None:
        """Write the script of all verbs as they are installed."""
        script = fish_script(VERBS) if self.shell == "fish" else bash_script(VERBS)
        if self.shell == "zsh":
            script = f"autoload -U +X bashcompinit && bashcompinit\n{script}"
        if self.json:
            return {"shell": self.shell, "script": script}
        print(script)
        return None


def options_of(verb: type[Any]) -> dict[str, tuple[str, ...]]:
    """Options that a verb's class takes, each with its choices; of those with any value, none."""
    hints, found = get_type_hints(verb, include_extras=True), dict[str, tuple[str, ...]]()
    for entry in fields(verb):
        hint = hints[entry.name]
        if tyro.conf.Positional not in getattr(hint, "__metadata__", ()):
            name = f"{'no-' if entry.default is True else ''}{entry.name.replace('_', '-')}"
            found[f"--{name}"] = tuple(_choices(hint))
    return found


def _choices(hint: Any) -> Iterator[str]:
    for part in get_args(hint):
        if get_origin(hint) is Literal:
            yield str(part)
        else:
            yield from _choices(part)


def _second_words(verbs: Mapping[str, str], first: str) -> list[str]:
    return [name.split()[1] for name in verbs if name.startswith(f"{first} ")]


def _first_words(verbs: Mapping[str, str]) -> list[str]:
    return list(dict.fromkeys(name.split()[0] for name in verbs))


def bash_script(verbs: Mapping[str, str]) -> str:
    """Script of bash, which zsh understands too: one case for each verb, and one for each option with choices."""
    names, words, choices = list[str](), list[str](), list[str]()
    for first in _first_words(verbs):
        second = _second_words(verbs, first)
        names += [f'    "{first} {word}") verb="{first} {word}" at=2 ;;' for word in second]
        names.append(f'    "{first} "*) verb="{first}" ;;')
        if first not in verbs:
            words.append(f'    "{first}") words="{" ".join(second)}" ;;')
    for name in verbs:
        options = options_of(load_verb(name))
        offered = " ".join([*_second_words(verbs, name), *options, "--help"])
        words.append(f'    "{name}") words="{offered}" ;;')
        choices += [f'    "{name} {one}") words="{" ".join(some)}" ;;' for one, some in options.items() if some]
    lines = [
        "_haustra() {",
        '  local current="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD-1]}" verb="" words="" at=1',
        '  case "${COMP_WORDS[1]} ${COMP_WORDS[2]}" in',
        *names,
        "  esac",
        '  if [ "$COMP_CWORD" -le "$at" ]; then verb="${verb% *}"; fi',
        f'  if [ "$COMP_CWORD" -eq 1 ]; then words="{" ".join(_first_words(verbs))} --help"; else',
        '  case "$verb" in',
        *words,
        "  esac",
        '  case "$verb $before" in',
        *choices,
        "  esac; fi",
        '  COMPREPLY=($(compgen -W "$words" -- "$current"))',
        "}",
        "complete -o default -F _haustra haustra",
    ]
    return "\n".join(lines)


def fish_script(verbs: Mapping[str, str]) -> str:
    """Script of fish: one line for each verb, and one for each option."""
    lines = [
        "function __haustra_verb",
        "  set -l words (commandline -opc)",
        '  string match -q -- "$argv *" "$words[2..-1] "',
        "end",
    ]
    for first in _first_words(verbs):
        about = first_sentence(first) if first in verbs else f"{', '.join(_second_words(verbs, first))}."
        lines.append(_line("__fish_is_nth_token 1", f"-xa {first}", about))
        lines += [
            _line(
                f"__fish_is_nth_token 2; and __haustra_verb {first}", f"-xa {word}", first_sentence(f"{first} {word}")
            )
            for word in _second_words(verbs, first)
        ]
    for name in verbs:
        second = _second_words(verbs, name)
        condition = f"__haustra_verb {name}" + (
            f"; and not __fish_seen_subcommand_from {' '.join(second)}" * bool(second)
        )
        for option, some in options_of(load_verb(name)).items():
            given = f" -xa '{' '.join(some)}'" if some else ""
            lines.append(_line(condition, f"-l {option.removeprefix('--')}{given}", ""))
    return "\n".join(lines)


def _line(condition: str, offered: str, about: str) -> str:
    told = about.replace("\\", "\\\\").replace("'", "\\'")
    return f"complete -c haustra -n '{condition}' {offered}" + (f" -d '{told}'" if about else "")
