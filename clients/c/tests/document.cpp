// The JSON of a plan of a folder of OBJ files: document RUNTIME_DIR FOLDER NAME UNITS FIXED... `.ci/c` compares it with the command
// line's.
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>

#include "sbdp.hpp"

// Whether a name comes first: numbers in names by their value.
static bool comes_first(const std::string &a, const std::string &b) {
    std::size_t i = 0, j = 0;
    const auto number = [](const std::string &text, std::size_t &at) {
        unsigned long long value = 0;
        for (; at < text.size() && std::isdigit(static_cast<unsigned char>(text[at])); ++at) {
            value = 10 * value + static_cast<unsigned long long>(text[at] - '0');
        }
        return value;
    };
    while (i < a.size() && j < b.size()) {
        if (std::isdigit(static_cast<unsigned char>(a[i])) && std::isdigit(static_cast<unsigned char>(b[j]))) {
            const auto one = number(a, i), other = number(b, j);
            if (one != other) {
                return one < other;
            }
        } else if (a[i] != b[j]) {
            return a[i] < b[j];
        } else {
            ++i, ++j;
        }
    }
    return a.size() - i < b.size() - j;
}

// What the parts borrow: of a file that has no other lines of use.
struct Mesh {
    std::string name;
    std::vector<double> vertices;
    std::vector<std::uint32_t> triangles;
};

static Mesh mesh(const std::filesystem::path &file) {
    Mesh mesh{file.stem().string(), {}, {}};
    std::ifstream lines(file);
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string word;
        words >> word;
        if (word == "v") {
            for (double value = 0; words >> value;) {
                mesh.vertices.push_back(value);
            }
        } else if (word == "f") {
            while (words >> word) {
                mesh.triangles.push_back(static_cast<std::uint32_t>(std::stoul(word)) - 1);
            }
        }
    }
    return mesh;
}

int main(int count, char **arguments) {
    if (count < 5) {
        return 2;
    }
    std::vector<std::filesystem::path> files;
    for (const auto &entry : std::filesystem::directory_iterator(arguments[2])) {
        if (entry.path().extension() == ".obj") {
            files.push_back(entry.path());
        }
    }
    std::sort(files.begin(), files.end(), [](const auto &a, const auto &b) {
        return comes_first(a.stem().string(), b.stem().string());
    });
    sbdp::Assembly assembly;
    assembly.name = arguments[3];
    assembly.units = arguments[4];
    assembly.fixed.assign(arguments + 5, arguments + count);
    std::vector<Mesh> meshes;
    std::transform(files.begin(), files.end(), std::back_inserter(meshes), mesh);
    for (const Mesh &mesh : meshes) {
        assembly.parts.emplace_back(mesh.name.c_str(), mesh.vertices, mesh.triangles);
    }
    // As the command line, which names them in the request, too.
    sbdp::PlanOptions wanted;
    for (std::uint32_t k = 0; k < meshes.size(); ++k) {
        if (std::count(assembly.fixed.begin(), assembly.fixed.end(), meshes[k].name) != 0) {
            wanted.fixed.push_back(k);
        }
    }
    sbdp::ConnectOptions options;
    options.runtime_dir = arguments[1];
    sbdp::Client client(options);
    std::cout << client.plan(client.upload(assembly), wanted).to_end().to_json();
}
