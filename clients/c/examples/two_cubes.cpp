// Two cubes, one on the other: two_cubes [RUNTIME_DIR].
#include <iostream>

#include <sbdp.hpp>

int main(int count, char **arguments) try {
    const std::vector<std::uint32_t> triangles{0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                               2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    const std::vector<double> low{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1};
    const std::vector<double> high{0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1, 0, 0, 2, 1, 0, 2, 0, 1, 2, 1, 1, 2};
    sbdp::ConnectOptions options;
    options.runtime_dir = count > 1 ? arguments[1] : "";
    const sbdp::Client client(options);
    const sbdp::Plan plan = client.plan(client.upload({{{"low", low, triangles}, {"high", high, triangles}}, "cubes", "mm", {}})).to_end();
    for (std::size_t i = 0; i < plan.size(); ++i) {
        std::cout << plan.summary().part_name(plan[i].parts()[0]) << ": " << plan[i].path().size() << " waypoints\n";
    }
} catch (const sbdp::Error &error) {
    std::cerr << error.what() << '\n';
    return 1;
}
