# SPDX-License-Identifier: BSD-3-Clause
# bash completion: commands, and their options, as `tetlod help` says them; fields, as the file has them that is named
_tetlod_fields() {
    local word=$1 program=$2 file name names
    COMPREPLY=()
    for file in "${@:3}"; do
        if [ -f "$file" ]; then
            # A name with a blank is quoted; a file that takes long to read is not waited for
            mapfile -t names < <(timeout 5 "$program" formats --fields "$file" 2>/dev/null)
            for name in "${names[@]}"; do
                [[ $name != "$word"* ]] || COMPREPLY+=("$(printf '%q' "$name")")
            done
            return
        fi
    done
}
_tetlod() {
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} program=${COMP_WORDS[0]}
    if [ "$COMP_CWORD" = 1 ] || { [ "$COMP_CWORD" = 2 ] && [ "$before" = help ]; }; then
        mapfile -t COMPREPLY < <(compgen -W "help $("$program" help 2>/dev/null | sed -n 's/^  \([a-z-]\{1,\}\)  *[^ ].*/\1/p')" -- "$word")
        return
    fi
    case $before in
    --measure) mapfile -t COMPREPLY < <(compgen -W 'max sampled rms predicted' -- "$word") ;;
    --certify) mapfile -t COMPREPLY < <(compgen -W 'fast exact' -- "$word") ;;
    --contract) mapfile -t COMPREPLY < <(compgen -W 'edge face tet hybrid' -- "$word") ;;
    --field|--carry|--no-field|--fields) _tetlod_fields "$word" "$program" "${COMP_WORDS[@]:2}" ;;
    --for) mapfile -t COMPREPLY < <(compgen -W 'mail' -- "$word") ;;
    *)
        case $word in
        -*) mapfile -t COMPREPLY < <(compgen -W "$("$program" help "${COMP_WORDS[1]}" 2>/dev/null | grep -o -- '--[a-z][a-z0-9-]*' | sort -u)" -- "$word") ;;
        *) mapfile -t COMPREPLY < <(compgen -f -- "$word") ;;
        esac
        ;;
    esac
}
complete -o filenames -F _tetlod tetlod
