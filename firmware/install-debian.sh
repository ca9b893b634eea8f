#!/bin/sh
# Install Debian packages, where this user may: install-debian.sh WHAT_FOR PACKAGE ...
set -u
what="$1"
shift
packages="$*"
if ! command -v dpkg-query >/dev/null; then
    echo "$what: no Debian here; install what these packages hold yourself: $packages" >&2
    exit 1
fi
missing=""
for package in $packages; do
    case "$(dpkg-query -W -f '${Status}' "$package" 2>/dev/null)" in
        *"ok installed") ;;
        *) missing="$missing $package" ;;
    esac
done
[ -z "$missing" ] && exit 0
if [ "$(id -u)" = 0 ]; then
    root=""
elif sudo -n true 2>/dev/null; then
    root="sudo -n"
else
    echo "$what: not installed here:$missing (as root: apt-get install --no-install-recommends$missing)" >&2
    exit 1
fi
echo "$what: installing$missing ..."
get="$root env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=120"
# shellcheck disable=SC2086
if ! $get install --no-install-recommends $missing >/dev/null 2>&1; then
    # The lists of packages of a fresh machine are empty, or too old.
    $get update >/dev/null && $get install --no-install-recommends $missing >/dev/null ||
        { echo "$what: apt-get could not install$missing" >&2; exit 1; }
fi
