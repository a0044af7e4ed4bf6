// A node of other people's DDS: Fast DDS, the way rmw_fastrtps uses it, with raw CDR under the types'
// names. `peer DOMAIN SECONDS` prints what it discovers and receives, a line each, and for 2 s of that
// time repeats a Bool on /tautwave/engage: false, then true.
//
//     g++ -std=c++17 tests/view/ros/peer.cpp -lfastrtps -lfastcdr -o peer

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using Bytes = std::vector<unsigned char>;

static std::mutex printing;

struct Raw : TopicDataType {
    explicit Raw(const std::string& name) {
        setName(name.c_str());
        m_typeSize = 65536;
        auto_fill_type_object(false);
        auto_fill_type_information(false);
    }
    bool serialize(void* data, SerializedPayload_t* payload) override {
        const auto& bytes = *static_cast<Bytes*>(data);
        std::memcpy(payload->data, bytes.data(), bytes.size());
        payload->length = bytes.size();
        return true;
    }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
        return [data] { return static_cast<uint32_t>(static_cast<Bytes*>(data)->size()); };
    }
    void* createData() override { return new Bytes; }
    void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
    bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

struct Reading : DataReaderListener {
    std::string name;
    void on_data_available(DataReader* reader) override {
        Bytes bytes;
        SampleInfo info;
        while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            std::lock_guard<std::mutex> lock(printing);
            std::printf("got %s ", name.c_str());
            for (unsigned char byte : bytes) std::printf("%02x", byte);
            std::printf("\n");
        }
    }
};

struct Discovering : DomainParticipantListener {
    void on_participant_discovery(
        DomainParticipant*, eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override {
        const auto& data = info.info.m_userData;
        std::lock_guard<std::mutex> lock(printing);
        std::printf("participant %.*s\n", int(data.size()), (const char*)data.data());
    }
    void on_publisher_discovery(
        DomainParticipant*, eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override {
        const auto& data = info.info.m_qos.m_userData;
        std::lock_guard<std::mutex> lock(printing);
        std::printf("writer %s %s %.*s\n", info.info.topicName().c_str(),
                    info.info.typeName().c_str(), int(data.size()), (const char*)data.data());
    }
};

int main(int, char** words) {
    auto* factory = DomainParticipantFactory::get_instance();
    Discovering discovering;
    auto* participant = factory->create_participant(
        std::atoi(words[1]), PARTICIPANT_QOS_DEFAULT, &discovering, StatusMask::none());
    auto* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    auto* publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    std::map<std::string, Topic*> topics;
    auto topic = [&](const std::string& name, const std::string& type) {
        if (!topics.count(name)) {
            TypeSupport support(new Raw(type));
            support.register_type(participant);
            topics[name] = participant->create_topic(name, type, TOPIC_QOS_DEFAULT);
        }
        return topics[name];
    };
    std::vector<std::unique_ptr<Reading>> readings;
    auto read = [&](const std::string& label, const std::string& name, const std::string& type,
                    bool reliable, bool late) {
        DataReaderQos qos = DATAREADER_QOS_DEFAULT;
        qos.reliability().kind = reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
        qos.durability().kind = late ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
        qos.history().depth = 100;
        readings.push_back(std::make_unique<Reading>());
        readings.back()->name = label;
        subscriber->create_datareader(topic(name, type), qos, readings.back().get());
    };
    const std::string joints = "sensor_msgs::msg::dds_::JointState_";
    read("reliable", "rt/master/joint_states", joints, true, false);
    read("best_effort", "rt/master/joint_states", joints, false, false);
    read("diagnostics", "rt/diagnostics", "diagnostic_msgs::msg::dds_::DiagnosticArray_", true, false);
    read("wrench", "rt/slave/wrench", "geometry_msgs::msg::dds_::WrenchStamped_", true, false);
    read("nodes", "ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_", true,
         true);
    auto* writer = publisher->create_datawriter(
        topic("rt/tautwave/engage", "std_msgs::msg::dds_::Bool_"), DATAWRITER_QOS_DEFAULT);
    const double seconds = std::atof(words[2]);
    const int ticks = int(20 * seconds);
    for (int k = 0; k < ticks; ++k) {
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        if (k < ticks - 60 || k >= ticks - 20) continue;
        Bytes yes{0, 1, 0, 0, (unsigned char)(k >= ticks - 55)};
        writer->write(&yes);
    }
    std::fflush(stdout);
    std::_Exit(0);
}
