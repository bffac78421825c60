/* Checks that libclang works for bindgen: searches like bindgen, loads the same library, and parses the headers that
   RocksDB includes.

   If it works, prints nothing and exits with 0; otherwise prints the reason and exits with 1.
   A folder as the argument replaces the root folder of the search (for tests).

   The order of the search is that of clang-sys 1.9 (its build/common.rs and build/dynamic.rs): only LIBCLANG_PATH, if it is set; otherwise
   the folder from llvm-config, LD_LIBRARY_PATH, LIBRARY_PATH and the usual folders; the file with the highest version wins.
   The folders with headers are those of bindgen 0.73: libclang's own, those of the program clang, and BINDGEN_EXTRA_CLANG_ARGS. */

#include <dlfcn.h>
#include <glob.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* The folders that clang-sys searches on Linux, and the file names that it accepts. */
static const char *const FOLDERS[] = {
    "/usr/local/llvm*/lib*", "/usr/local/lib*/*/*", "/usr/local/lib*/*", "/usr/local/lib*", "/usr/lib*/*/*", "/usr/lib*/*", "/usr/lib*",
};
static const char *const NAMES[] = {"libclang.so", "libclang-*.so", "libclang.so.*", "libclang-*.so.*"};
#define COUNT(array) (sizeof(array) / sizeof *(array))

static char best[PATH_MAX];
static char best_version[NAME_MAX + 1];

/* The version in a file name, as clang-sys parses it: "" in `libclang.so`, "14" in `libclang-14.so`, "1" in `libclang.so.1`. */
static void version_of(const char *name, char *version) {
    version[0] = '\0';
    if (strncmp(name, "libclang.so.", 12) == 0) {
        strcpy(version, name + 12);
    } else if (strncmp(name, "libclang-", 9) == 0 && strlen(name) > 12) {
        strcpy(version, name + 9);
        version[strlen(version) - 3] = '\0';
    }
}

/* Compares two versions part by part; a part that is not a number counts as 0. */
static int is_higher(const char *one, const char *other) {
    while (*one && *other) {
        char *one_end, *other_end;
        long one_part = strtol(one, &one_end, 10), other_part = strtol(other, &other_end, 10);
        if (*one_end && *one_end != '.') one_part = 0;
        if (*other_end && *other_end != '.') other_part = 0;
        if (one_part != other_part) return one_part > other_part;
        one += strcspn(one, "."), other += strcspn(other, ".");
        one += *one == '.', other += *other == '.';
    }
    return *one != '\0' && *other == '\0';
}

/* Whether the file is a library of this machine's word size. */
static int is_library(const char *path) {
    unsigned char head[5] = {0};
    FILE *file = fopen(path, "rb");
    if (!file) return 0;
    size_t length = fread(head, 1, sizeof head, file);
    fclose(file);
    return length == sizeof head && memcmp(head, "\177ELF", 4) == 0 && head[4] == (sizeof(void *) == 8 ? 2 : 1);
}

static void consider(const char *path) {
    const char *name = strrchr(path, '/') ? strrchr(path, '/') + 1 : path;
    char version[NAME_MAX + 1];
    /* libclang-cpp is a different library. */
    if (strstr(name, "-cpp.") || strlen(path) >= sizeof best || strlen(name) > NAME_MAX || !is_library(path)) return;
    version_of(name, version);
    if (!best[0] || is_higher(version, best_version)) {
        strcpy(best, path);
        strcpy(best_version, version);
    }
}

static void look_in(const char *folder) {
    for (size_t idx = 0; idx < COUNT(NAMES); idx++) {
        char pattern[PATH_MAX];
        glob_t found;
        if (snprintf(pattern, sizeof pattern, "%s/%s", folder, NAMES[idx]) >= (int)sizeof pattern) continue;
        if (glob(pattern, 0, NULL, &found) == 0) {
            for (size_t at = 0; at < found.gl_pathc; at++) consider(found.gl_pathv[at]);
            globfree(&found);
        }
    }
}

static void look_in_list(const char *folders) {
    char *copy = folders ? strdup(folders) : NULL;
    for (char *folder = copy ? strtok(copy, ":") : NULL; folder; folder = strtok(NULL, ":")) look_in(folder);
    free(copy);
}

static void look_where_llvm_is(void) {
    const char *command = getenv("LLVM_CONFIG_PATH");
    char line[PATH_MAX], folder[PATH_MAX + 8];
    snprintf(line, sizeof line, "'%s' --prefix 2>/dev/null", command ? command : "llvm-config");
    FILE *answer = popen(line, "r");
    if (answer && fgets(line, sizeof line, answer)) {
        static const char *const BELOW[] = {"bin", "lib", "lib64"};
        line[strcspn(line, "\n")] = '\0';
        for (size_t idx = 0; idx < COUNT(BELOW); idx++) {
            snprintf(folder, sizeof folder, "%s/%s", line, BELOW[idx]);
            look_in(folder);
        }
    }
    if (answer) pclose(answer);
}

static void look_everywhere(const char *root) {
    look_where_llvm_is();
    look_in_list(getenv("LD_LIBRARY_PATH"));
    look_in_list(getenv("LIBRARY_PATH"));
    for (size_t idx = 0; idx < COUNT(FOLDERS); idx++) {
        char pattern[PATH_MAX];
        glob_t found;
        if (snprintf(pattern, sizeof pattern, "%s%s", root, FOLDERS[idx]) >= (int)sizeof pattern) continue;
        if (glob(pattern, 0, NULL, &found) == 0) {
            for (size_t at = 0; at < found.gl_pathc; at++) look_in(found.gl_pathv[at]);
            globfree(&found);
        }
    }
}

/* Arguments for libclang besides the header, the same as bindgen's. */
#define MOST_WORDS 256
static const char *words[MOST_WORDS] = {"-x", "c"};
static int n_words = 2;

static void give(const char *word) {
    if (n_words < MOST_WORDS) words[n_words++] = strdup(word);
}

static void give_extra(void) {
    const char *extra = getenv("BINDGEN_EXTRA_CLANG_ARGS");
    char *copy = extra ? strdup(extra) : NULL;
    for (char *word = copy ? strtok(copy, " ") : NULL; word; word = strtok(NULL, " ")) give(word);
    free(copy);
}

/* Adds the search folders of the program clang, if there is one: CLANG_PATH, or the first one in PATH. */
static void give_search_paths(void) {
    static const char ASK[] = "unset found; is() { [ -f \"$1\" ] && [ -x \"$1\" ] && found=$1; }; is \"$CLANG_PATH\" || {"
        " bin=$(\"${LLVM_CONFIG_PATH:-llvm-config}\" --bindir 2> /dev/null); IFS=:;"
        " for folder in $bin $PATH; do for file in \"$folder\"/clang \"$folder\"/clang-[0-9]*; do is \"$file\" && break 2; done; done; };"
        " IFS=' '; [ -z \"$found\" ] || \"$found\" -E -x c - -v $BINDGEN_EXTRA_CLANG_ARGS 2>&1 > /dev/null < /dev/null";
    char line[PATH_MAX];
    int is_within = 0;
    FILE *answer = popen(ASK, "r");
    while (answer && fgets(line, sizeof line, answer)) {
        line[strcspn(line, "\n")] = '\0';
        if (strncmp(line, "End of search list.", 19) == 0) is_within = 0;
        if (is_within) {
            give("-isystem");
            give(line + strspn(line, " "));
        }
        if (strncmp(line, "#include <...> search starts here:", 34) == 0) is_within = 1;
    }
    if (answer) pclose(answer);
}

/* Lets a library parse the headers that RocksDB's C interface includes; this fails without clang's own headers. */
static int reads_headers(const char *path) {
    static const char HEADERS[] = "/tmp/actcheck-libclang-XXXXXX";
    static const char TEXT[] = "#include <stdarg.h>\n#include <stdbool.h>\n#include <stddef.h>\n#include <stdint.h>\n";
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) return printf("%s can't be loaded: %s\n", path, dlerror()), 0;
    void *(*make_index)(int, int);
    void *(*parse)(void *, const char *, const char *const *, int, void *, unsigned, unsigned);
    unsigned (*faults)(void *);
    *(void **)&make_index = dlsym(library, "clang_createIndex");
    *(void **)&parse = dlsym(library, "clang_parseTranslationUnit");
    *(void **)&faults = dlsym(library, "clang_getNumDiagnostics");
    if (!make_index || !parse || !faults) return printf("%s is not libclang\n", path), 0;

    char header[sizeof HEADERS + 2];
    strcpy(header, HEADERS);
    int file = mkstemp(header);
    if (file < 0 || write(file, TEXT, sizeof TEXT - 1) != (ssize_t)(sizeof TEXT - 1)) {
        return printf("%s can't be tried: nothing can be written to /tmp\n", path), 0;
    }
    close(file);
    give_extra();
    give_search_paths();
    void *unit = parse(make_index(0, 0), header, words, n_words, NULL, 0, 0);
    int works = unit && faults(unit) == 0;
    unlink(header);
    if (!works) printf("%s lacks clang's own headers, such as stddef.h\n", path);
    return works;
}

int main(int count, char **arguments) {
    const char *named = getenv("LIBCLANG_PATH");
    if (named) {
        /* A file or a folder. */
        struct stat found;
        if (stat(named, &found) == 0 && !S_ISDIR(found.st_mode)) consider(named);
        else look_in(named);
        if (!best[0]) return printf("LIBCLANG_PATH is wrong: there is no libclang at %s\n", named), 1;
    } else {
        look_everywhere(count > 1 ? arguments[1] : "");
        if (!best[0]) return printf("there is no libclang\n"), 1;
    }
    return reads_headers(best) ? 0 : 1;
}
