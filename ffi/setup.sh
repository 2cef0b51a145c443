#!/usr/bin/env bash
# Brings the native parts of Tress onto a fresh Debian: Embree 4.3 or newer, OpenImageIO, and what their bindings need to build.
#
#   Debian 13: everything from Debian.
#   Debian 12 (x86-64): Debian 12 packages Embree 3 only, whose interface differs. So Embree's headers come from Debian 13's
#   libembree-dev (unpacked, not installed; apt checks its signature) and the library from a Python wheel that carries it
#   (pinned by hash). Both go into ffi/native/, nothing else is touched.
#
# Needs: Debian, cargo, and root or sudo if packages are missing. Running it again does nothing once all is there.
set -Eeuo pipefail
export LC_ALL=C

here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
native=$here/native
os_release=${TRESS_OS_RELEASE:-/etc/os-release} # replaced by the tests only

wheel='embreex==4.4.0.post1'
wheel_sha256=2cd0f7d5c6342e6247e31f700761689cae7829454d8c6de0c41e62124a023e1f
embree_file=libembree4-4aef3270.so.4
embree_sha256=aa4eb9d81e30237d032418832efd9caee19bead50f49939fb08347a053898c7a
tbb_file=libtbb-dcf63f8c.so.12
tbb_sha256=08d7ce01dcce5c49f874ee91ba8dad75ee3aa1838d5ce8a92f5b2ec98b9df2ed
keyring=/usr/share/keyrings/debian-archive-keyring.gpg

step='starting'
work=
say() { printf 'setup: %s\n' "$*"; }
fail() { # what went wrong, what to do
    printf 'setup: failed while %s: %s\n' "$step" "$1" >&2
    printf '       %s\n' "$2" >&2
    exit 1
}
trap '[[ -z $work ]] || rm -rf -- "$work"' EXIT
trap 'fail "unexpected error at line $LINENO" "Nothing in ffi/native was changed; run ffi/setup.sh again once the cause above is mended."' ERR
trap 'fail "interrupted" "Run ffi/setup.sh again."' INT TERM

debian_version() {
    step='looking at the system'
    local id version
    [[ -r $os_release ]] || fail "$os_release cannot be read" 'This script knows Debian 12 and 13 only. Elsewhere, install Embree 4.3+ and OpenImageIO 2.4+ and set EMBREE_DIR.'
    # A subshell each: os-release is shell code that sets many variables.
    # shellcheck source=/dev/null
    id=$(. "$os_release" && echo "${ID:-unknown}")
    # shellcheck source=/dev/null
    version=$(. "$os_release" && echo "${VERSION_ID:-unknown}")
    if [[ $id != debian || ! $version =~ ^1[23]$ ]]; then
        fail "this is '$id $version', not Debian 12 or 13" \
            'Install Embree 4.3 or newer and OpenImageIO 2.4 or 2.5 with their headers yourself; set EMBREE_DIR to the folder that holds include/embree4 and lib.'
    fi
    if [[ $version == 12 && $(uname -m) != x86_64 ]]; then
        fail "Embree for Debian 12 is at hand for x86_64 only, this is $(uname -m)" \
            'Use Debian 13, or build Embree 4.3+ yourself and set EMBREE_DIR to the folder that holds include/embree4 and lib.'
    fi
    debian=$version
}

require_cargo() {
    step='looking for cargo'
    local home=$HOME
    # Under sudo the caller's toolchain counts, not root's.
    [[ -z ${SUDO_USER:-} ]] || home=$(getent passwd "$SUDO_USER" | cut -d: -f6)
    command -v cargo >/dev/null || [[ -x ${CARGO_HOME:-$home/.cargo}/bin/cargo ]] ||
        fail 'cargo was not found' 'Install Rust 1.88 or newer first (with rustup; Debian 13 has a package of that name), then run ffi/setup.sh again.'
}

# Runs a command as root, with sudo if need be.
as_root() {
    if ((EUID == 0)); then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo -- "$@"
    else
        fail "root is needed to run '$*', and there is no sudo" 'Run ffi/setup.sh as root, or install sudo.'
    fi
}

apt_root() { as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=120 -o Acquire::Retries=3 "$@"; }

update_lists() {
    apt_root update >&2 || fail 'apt-get update failed (its message is above)' 'Check the network, the proxy and /etc/apt/sources.list*, then run ffi/setup.sh again.'
}

# Installs those of the named packages that are missing.
install_packages() {
    step='installing Debian packages'
    local missing=() package
    for package in "$@"; do
        [[ $(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true) == installed ]] || missing+=("$package")
    done
    ((${#missing[@]})) || return 0
    ((EUID == 0)) || command -v sudo >/dev/null ||
        fail "these are missing, this is not root and there is no sudo: ${missing[*]}" \
            "Run ffi/setup.sh as root, install sudo, or have someone run: apt-get install --no-install-recommends ${missing[*]}"
    say "installing Debian packages: ${missing[*]}"
    update_lists
    apt_root install --no-install-recommends "${missing[@]}" >&2 ||
        fail 'apt-get install failed (its message is above)' 'Mend what it names (disk space, held packages, network), then run ffi/setup.sh again.'
}

# True when ffi/native holds the pinned libraries and the headers as they were unpacked.
native_complete() {
    [[ -f $native/SHA256SUMS && -f $native/lib/libembree4.so ]] || return 1
    (cd -- "$native" && sha256sum --check --status --strict SHA256SUMS) || return 1
    check_libraries "$native/lib"
}

check_libraries() {
    printf '%s  %s\n' "$embree_sha256" "$1/$embree_file" "$tbb_sha256" "$1/$tbb_file" | sha256sum --check --status --strict
}

# Debian's own repository as this machine has it configured: a mirror stays a mirror.
debian_repository() {
    # shellcheck disable=SC2016 # apt expands these, not the shell
    apt-get indextargets --format '$(REPO_URI) $(ORIGIN) $(CODENAME)' 'Created-By: Packages' |
        awk '$2 == "Debian" && $3 == "bookworm" { print $1; exit }'
}

fetch_headers() {
    step="fetching Embree's headers (Debian 13's libembree-dev)"
    say "$step"
    local repository
    repository=$(debian_repository)
    if [[ -z $repository ]]; then
        update_lists
        repository=$(debian_repository)
    fi
    [[ -n $repository ]] || fail 'apt knows no Debian repository for bookworm' 'Add one to /etc/apt/sources.list (see man sources.list), then run ffi/setup.sh again.'

    # Lists and cache of its own: the machine's apt never hears of Debian 13.
    local apt=$work/apt
    mkdir -p -- "$apt/lists/partial" "$apt/cache/archives/partial"
    echo "deb [arch=amd64 signed-by=$keyring] $repository trixie main" >"$apt/sources.list"
    local options=(
        -q -o "Dir::Etc::sourcelist=$apt/sources.list" -o Dir::Etc::sourceparts=/dev/null -o Dir::Etc::preferencesparts=/dev/null
        -o "Dir::State::Lists=$apt/lists" -o "Dir::Cache=$apt/cache" -o APT::Sandbox::User=root -o APT::Architecture=amd64
        -o Acquire::Languages=none -o Acquire::IndexTargets::deb::DEP-11::DefaultEnabled=false -o APT::Update::Error-Mode=any -o Acquire::Retries=3
    )
    local advice='Check the network and that the repository above carries trixie (a private mirror may not), then run ffi/setup.sh again.'
    apt-get "${options[@]}" update >&2 || fail "apt cannot read trixie from $repository" "$advice"
    (cd -- "$work" && apt-get "${options[@]}" download libembree-dev >&2) || fail "apt cannot download libembree-dev from $repository" "$advice"

    local packages=("$work"/libembree-dev_*.deb)
    dpkg -x "${packages[0]}" "$work/headers" || fail "${packages[0]##*/} cannot be unpacked" 'Check the disk space, then run ffi/setup.sh again.'
    mkdir -p -- "$work/native/include"
    cp -R -- "$work/headers/usr/include/embree4" "$work/native/include/"
    # The struct layouts of 4.3 are those of the 4.4 library; a later minor version might not keep them.
    grep -Eq '^#define RTC_VERSION 403[0-9][0-9]$' "$work/native/include/embree4/rtcore_config.h" ||
        fail "libembree-dev of Debian 13 is not Embree 4.3 any more (${packages[0]##*/})" 'The pinned library no longer goes with it: please report this.'
}

fetch_library() {
    step="fetching Embree's library (wheel $wheel)"
    say "$step"
    # Debian's own python3, whatever pyenv or a virtual environment put before it; the explicit tags make any version do.
    local python=/usr/bin/python3
    echo "$wheel --hash=sha256:$wheel_sha256" >"$work/requirements.txt"
    env -u PYTHONHOME -u PYTHONPATH PIP_REQUIRE_VIRTUALENV=0 "$python" -m pip download --quiet --no-input --no-cache-dir \
        --disable-pip-version-check --retries 3 --require-hashes --no-deps --only-binary=:all: \
        --implementation cp --python-version 311 --abi cp311 --platform manylinux_2_28_x86_64 \
        --dest "$work/wheel" --requirement "$work/requirements.txt" >&2 ||
        fail 'pip download failed (its message is above)' \
            'Network, proxy or its certificate (PIP_CERT): mend it (pip reads its own configuration) and run ffi/setup.sh again. A hash that differs: the file is not the one Tress was tested with; do not use it.'
    mkdir -p -- "$work/native/lib" "$work/unzipped"
    local wheels=("$work/wheel"/*.whl)
    "$python" -m zipfile -e "${wheels[0]}" "$work/unzipped" || fail "${wheels[0]##*/} cannot be unpacked" 'Check the disk space, then run ffi/setup.sh again.'
    local file found
    for file in "$embree_file" "$tbb_file"; do
        found=$(find "$work/unzipped" -name "$file" -print -quit)
        [[ -n $found ]] || fail "the wheel does not hold $file" 'Please report this.'
        install -m 755 -- "$found" "$work/native/lib/$file"
    done
    check_libraries "$work/native/lib" || fail "the sha256 of $embree_file or $tbb_file is not the expected one" 'The file is not the one Tress was tested with; do not use it.'
    ln -s -- "$embree_file" "$work/native/lib/libembree4.so"
}

# Into place by one rename, so that an interrupted run leaves nothing half done.
put_in_place() {
    step='putting the files into ffi/native'
    find "$work/native" -type f -exec touch {} + # packages keep old dates, which cargo would take for "unchanged"
    (cd -- "$work/native" && find include lib -type f -print0 | sort -z | xargs -0 sha256sum >"$work/SHA256SUMS")
    mv -- "$work/SHA256SUMS" "$work/native/SHA256SUMS"
    chmod -R u=rwX,go=rX -- "$work/native"
    [[ ! -e $native ]] || mv -T -- "$native" "$work/replaced"
    mv -T -- "$work/native" "$native"
    # Run with sudo, the files still belong to the one who builds.
    ((EUID != 0)) || chown -R --reference="$here" -- "$native"
}

main() {
    debian_version
    require_cargo
    local common=(g++ pkg-config libclang-dev libopenimageio-dev openimageio-tools ca-certificates)
    if [[ $debian == 13 ]]; then
        install_packages "${common[@]}" libembree-dev
    else
        install_packages "${common[@]}" python3-pip debian-archive-keyring
        if ! native_complete; then
            # Old images of Debian 12 carry a keyring that does not know Debian 13 yet.
            if [[ ! -e /usr/share/keyrings/debian-archive-trixie-stable.gpg ]]; then
                step="bringing Debian's keyring up to date"
                say "$step"
                update_lists
                apt_root install --no-install-recommends debian-archive-keyring >&2 || fail 'apt-get install failed (its message is above)' 'Mend what it names, then run ffi/setup.sh again.'
            fi
            step='making a temporary folder'
            work=$(mktemp -d -- "$here/.native.XXXXXX") || fail "cannot write to $here" 'Make the folder writable, then run ffi/setup.sh again.'
            fetch_headers
            fetch_library
            put_in_place
        fi
    fi
    say "all native parts are in place (Debian $debian)"
}

main "$@"
